//! The results store: append-only, keyed by content, whole after a kill at any byte.

use super::made_up::{figures, options, record, score, scored};
use proptest::prelude::{Strategy, any, prop, prop_assert, prop_assert_eq, proptest};
use skinsplat::experiment::{Experiment, FrameRecord, Job, Outcome, Plan, Records, Shard, plan};
use skinsplat::run::Machine;
use skinsplat::run::store::{self, Store, outstanding};
use std::collections::BTreeSet;
use std::path::PathBuf;

/// A store in its own folder, which lives as long as the first value.
fn place() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(store::FILE_NAME);
    (folder, path)
}

fn scored_at(key: &str, psnr: f64) -> FrameRecord {
    scored(key, score("avatar-v1", psnr, 0.5, None))
}

fn failed(key: &str) -> FrameRecord {
    record(key, Outcome::Error("no such \"file\"\nat all".into()))
}

/// A store's bytes and the records in the order in which they were appended.
fn written(records: &[FrameRecord]) -> Vec<u8> {
    let (_folder, path) = place();
    let mut store = Store::open(&path, "plan", &Machine::default()).unwrap();
    for record in records {
        store.append(std::slice::from_ref(record)).unwrap();
    }
    std::fs::read(&path).unwrap()
}

fn by_key(records: &[FrameRecord]) -> Records {
    records.iter().map(|record| (record.key.clone(), record.clone())).collect()
}

#[test]
fn what_is_appended_is_read_again() {
    let (_folder, path) = place();
    let identical = scored_at("identical images", f64::INFINITY);
    let precise = scored("precise", score("haha", 1.0 / 3.0, 0.1 + 0.2, Some(f64::MIN_POSITIVE)));
    let mut store = Store::open(&path, "plan", &Machine::default()).unwrap();
    store.append(&[identical.clone(), failed("b")]).unwrap();
    store.append(std::slice::from_ref(&precise)).unwrap();
    let expected = by_key(&[identical, failed("b"), precise]);
    assert_eq!(store.records(), &expected);
    assert_eq!(store::read(&path).unwrap(), expected);
    let before = std::fs::read(&path).unwrap();
    assert_eq!(Store::open(&path, "plan", &Machine::default()).unwrap().into_records(), expected);
    assert_eq!(std::fs::read(&path).unwrap(), before, "opening for the same plan writes nothing");
    assert_eq!(before.iter().filter(|&&byte| byte == b'\n').count(), 4);
}

/// Killed at any byte: what was whole is kept, the rest is done again, and the file ends as if nothing had happened.
#[test]
fn a_kill_at_any_byte_loses_at_most_the_torn_line() {
    let records = [scored_at("a", 20.0), failed("b"), scored_at("c", f64::INFINITY), scored_at("d", 31.5)];
    let bytes = written(&records);
    let (_folder, path) = place();
    for cut in 0..=bytes.len() {
        std::fs::write(&path, &bytes[..cut]).unwrap();
        let lines = bytes[..cut].iter().filter(|&&byte| byte == b'\n').count();
        let kept = &records[..lines.saturating_sub(1)];
        assert_eq!(store::read(&path).unwrap(), by_key(kept), "cut at {cut}");
        let mut store = Store::open(&path, "plan", &Machine::default()).unwrap();
        assert_eq!(store.records(), &by_key(kept), "cut at {cut}");
        for record in &records[kept.len()..] {
            store.append(std::slice::from_ref(record)).unwrap();
        }
        assert_eq!(std::fs::read(&path).unwrap(), bytes, "cut at {cut}");
    }
}

#[test]
fn equal_results_may_repeat_and_different_ones_may_not() {
    let (_folder, path) = place();
    let mut store = Store::open(&path, "plan", &Machine::default()).unwrap();
    store.append(&[scored_at("a", 20.0)]).unwrap();
    let mut slow = scored_at("a", 20.0);
    slow.seconds.render = 9.0;
    store.append(&[slow]).unwrap();
    let before = std::fs::read(&path).unwrap();
    let error = store.append(&[scored_at("new", 1.0), scored_at("a", 20.5)]).unwrap_err().to_string();
    assert!(
        error.contains("label of a") && error.contains("\"psnr\":20.0") && error.contains("\"psnr\":20.5"),
        "{error}"
    );
    assert!(error.contains("frames.jsonl, ") && error.contains(" at this run"), "{error}");
    assert_eq!(std::fs::read(&path).unwrap(), before, "a refused record is not written");
    assert!(!store.records().contains_key("new"));

    let (_other_folder, other) = place();
    Store::open(&other, "plan", &Machine::default())
        .unwrap()
        .append(&[scored_at("a", 20.5), scored_at("b", 1.0)])
        .unwrap();
    let error = store::merge([path.as_path(), other.as_path()]).unwrap_err();
    assert!(matches!(error, store::Error::Conflict { .. }), "{error}");
    let text = error.to_string();
    assert!(text.contains(path.to_str().unwrap()) && text.contains(other.to_str().unwrap()), "{text}");
    let both = [std::fs::read(&path).unwrap(), std::fs::read(&other).unwrap()].concat();
    std::fs::write(&other, both).unwrap();
    let text = store::read(&other).unwrap_err().to_string();
    assert!(text.contains("frames.jsonl:2, ") && text.contains("frames.jsonl:5;"), "{text}");
    std::fs::write(&other, written(&[scored_at("a", 20.0), scored_at("b", 1.0)])).unwrap();
    assert_eq!(store::merge([path.as_path(), other.as_path()]).unwrap().len(), 2);
}

#[test]
fn a_failure_is_replaced_by_a_score_and_never_replaces_one() {
    let (_folder, path) = place();
    let mut store = Store::open(&path, "plan", &Machine::default()).unwrap();
    for (next, expected) in [
        (failed("a"), failed("a")),
        (record("a", Outcome::Error("other".into())), record("a", Outcome::Error("other".into()))),
        (scored_at("a", 20.0), scored_at("a", 20.0)),
        (failed("a"), scored_at("a", 20.0)),
    ] {
        store.append(&[next]).unwrap();
        assert_eq!(store.records()["a"], expected);
    }
    assert_eq!(store::read(&path).unwrap(), by_key(&[scored_at("a", 20.0)]));
}

#[test]
fn another_plan_keeps_the_records_and_adds_a_header() {
    let (_folder, path) = place();
    Store::open(&path, "first", &Machine::default()).unwrap().append(&[scored_at("a", 20.0)]).unwrap();
    assert_eq!(
        Store::open(&path, "second", &Machine::default()).unwrap().into_records(),
        by_key(&[scored_at("a", 20.0)])
    );
    let text = std::fs::read_to_string(&path).unwrap();
    let headers: Vec<&str> = text.lines().filter(|line| line.contains("header")).collect();
    assert_eq!(
        headers,
        ["first", "second"].map(|plan| {
            format!(
                r#"{{"header":{{"schema":2,"plan":"{plan}","machine":{{"host":null,"processor":null}}}}}}"#
            )
        })
    );
    // Nor does another machine.
    let other = Machine { host: Some("n2".into()), processor: None };
    Store::open(&path, "second", &other).unwrap().append(&[scored_at("b", 1.0)]).unwrap();
    let contents = store::read_all(&path).unwrap();
    let hosts: Vec<_> = contents.entries.iter().map(|entry| entry.machine.host.as_deref()).collect();
    assert_eq!((hosts, contents.plan.as_deref()), (vec![None, Some("n2")], Some("second")));
}

#[test]
fn other_files_are_refused_and_left_alone() {
    let (_folder, path) = place();
    let store = String::from_utf8(written(&[scored_at("a", 20.0)])).unwrap();
    let cases = [
        (
            "PNG and no newline".to_owned(),
            ":1: not a results store; expected a line that begins with {\"header\":{",
        ),
        ("{\"a\": 1}\n".to_owned(), ":1: not a results store"),
        (store.replace("\"schema\":2", "\"schema\":1"), ":1: schema 1; expected 2"),
        (store.replace("\"psnr\":20.0", "\"psnr\":\"x\""), ":2: invalid type"),
        (format!("{store}\n"), ":3: EOF"),
        (store.replace("\"label\"", "\"labels\""), ":2: unknown field `labels`"),
    ];
    for (text, message) in cases {
        std::fs::write(&path, &text).unwrap();
        for error in
            [store::read(&path).unwrap_err(), Store::open(&path, "plan", &Machine::default()).unwrap_err()]
        {
            let error = error.to_string();
            assert!(error.contains(store::FILE_NAME) && error.contains(message), "{error}");
        }
        assert_eq!(std::fs::read_to_string(&path).unwrap(), text);
    }
    let error = store::read(&path.with_file_name("absent.jsonl")).unwrap_err().to_string();
    assert!(error.contains("absent.jsonl"), "{error}");
}

fn planned() -> Plan {
    plan(&Experiment::embedded(), &[figures()], &options()).unwrap()
}

fn jobs() -> Vec<Job> {
    planned().jobs
}

#[test]
fn a_key_that_two_tables_share_is_done_once() {
    let mut jobs = jobs();
    jobs.truncate(1);
    let mut twin = jobs[0].clone();
    twin.variants[0].key = "only here".into();
    jobs.push(twin);
    let left = outstanding(&jobs, &Records::new());
    let counts: Vec<usize> = left.iter().map(|job| job.variants.len()).collect();
    assert_eq!(counts, [2, 1]);
    assert_eq!(left[1].variants[0].key, "only here");
}

/// What a key's record is: nothing, a failure, a score.
fn outcomes() -> impl Strategy<Value = Vec<u8>> {
    proptest::collection::vec(0..3_u8, 400)
}

proptest! {
    /// Against a model: what is left is what has no score, once, in order, with nothing else changed.
    #[test]
    fn what_is_left_is_what_has_no_score(outcomes in outcomes(), index in 1..4_usize) {
        let jobs = planned().shard(Some(Shard::new(index, 3).unwrap()));
        let mut records = Records::new();
        let keys: BTreeSet<&str> = jobs.iter().flat_map(|job| &job.variants).map(|v| v.key.as_str()).collect();
        for (key, outcome) in keys.iter().zip(&outcomes) {
            match outcome {
                0 => {}
                1 => { records.insert((*key).to_owned(), failed(key)); }
                _ => { records.insert((*key).to_owned(), scored_at(key, 20.0)); }
            }
        }
        let left = outstanding(&jobs, &records);
        let mut expected = Vec::new();
        let mut seen = BTreeSet::new();
        for variant in jobs.iter().flat_map(|job| &job.variants) {
            let open = records.get(&variant.key).is_none_or(|r| matches!(r.outcome, Outcome::Error(_)));
            if open && seen.insert(&variant.key) {
                expected.push(variant.clone());
            }
        }
        let found: Vec<_> = left.iter().flat_map(|job| job.variants.clone()).collect();
        prop_assert_eq!(found, expected);
        prop_assert!(left.iter().all(|job| !job.variants.is_empty()));
        for job in &left {
            let origin = jobs.iter().any(|other| Job { variants: job.variants.clone(), ..other.clone() } == *job);
            prop_assert!(origin);
        }
    }

    /// Whatever bytes a file holds, reading answers or refuses, and opening never loses a whole line.
    #[test]
    fn damaged_files_are_answered_without_panic(position in any::<prop::sample::Index>(), byte in any::<u8>()) {
        let mut bytes = written(&[scored_at("a", 20.0), scored_at("b", 21.0)]);
        let position = position.index(bytes.len());
        bytes[position] = byte;
        let (_folder, path) = place();
        std::fs::write(&path, &bytes).unwrap();
        let whole = bytes.iter().rposition(|&b| b == b'\n').map_or(0, |last| last + 1);
        match (store::read(&path), Store::open(&path, "plan", &Machine::default())) {
            (Ok(read), Ok(store)) => {
                prop_assert_eq!(&read, store.records());
                prop_assert!(std::fs::read(&path).unwrap().starts_with(&bytes[..whole]));
            }
            (Err(_), Err(_)) => prop_assert_eq!(std::fs::read(&path).unwrap(), bytes),
            _ => prop_assert!(false, "reading and opening disagree"),
        }
    }
}
