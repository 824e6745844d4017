//! Pickles that Python 2.7 and 3 wrote (tests/data/make/pickles.py, bodies_python2.py), and such as nobody should write.

use crate::support::data;
use skinsplat_data::pickle::{Pickle, Rows};
use std::path::{Path, PathBuf};

fn small(name: &str) -> PathBuf {
    data("small/pickles").join(name)
}

fn read(name: &str) -> Pickle {
    Pickle::read(&small(name), "values").unwrap_or_else(|e| panic!("{e}"))
}

/// The error of bytes.
fn refusal(bytes: &[u8]) -> String {
    let result = Pickle::from_bytes(Path::new("x.pkl"), bytes.to_vec());
    result.map(|pickle| format!("read: {:?}", pickle.root().array())).unwrap_err().to_string()
}

#[test]
fn every_protocol_of_both_pythons_gives_the_same_values() {
    let python3 = (0..6).map(|protocol| format!("python3_{protocol}.pkl"));
    for name in python3.chain((0..3).map(|protocol| format!("python2_{protocol}.pkl"))) {
        let file = read(&name);
        let numbers = |key: &str, pattern: &str| {
            let field = file.get(key).unwrap_or_else(|e| panic!("{name}: {e}"));
            field.numbers(pattern).unwrap_or_else(|e| panic!("{name}: {e}")).values
        };
        assert_eq!(numbers("camera_f", "2"), [2664.5, 2665.5]);
        assert_eq!(numbers("camera_t", "N"), [0.0; 3]);
        assert_eq!(
            [file.get("width").unwrap(), file.get("height").unwrap()].map(|f| f.count().unwrap()),
            [1080; 2]
        );
        assert_eq!(file.get("name").unwrap().text().unwrap(), "female-3-casual");
        assert_eq!(file.get("unicode").unwrap().text().unwrap(), "été", "{name}");
        assert_eq!(numbers("flag", ""), [1.0]);
        assert!(!file.root().contains("none") && file.root().optional("none").unwrap().is_none());
        assert_eq!(file.get("long").unwrap().number().unwrap(), 4_294_967_295.0);
        assert!(file.get("huge").unwrap().number().unwrap_err().to_string().contains("beyond 64 bits"));
        assert_eq!(numbers("float", ""), [0.1]);
        assert_eq!(numbers("table", "2,3"), [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        assert_eq!(numbers("rows", "2,4"), [0.0, 1.0, 2.0, 3.0, 10.0, 11.0, 12.0, 13.0]);
        assert_eq!(numbers("small", "2,2"), [1.0, -2.0, 3.0, -4.0]);
        assert_eq!(numbers("big_endian", "2"), [1.5, -2.5]);
        assert_eq!(numbers("fortran", "2,3"), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0], "{name}");
        assert_eq!(numbers("bools", "2"), [1.0, 0.0]);
        assert_eq!(file.get("strings").unwrap().texts().unwrap(), ["ab", "c"], "{name}");
        assert_eq!(numbers("objects", "2,2"), [0.0, 1.0, 2.0, 3.0], "{name}");
        assert_eq!(numbers("scalar", ""), [0.25]);
        let nested = file.get("nested").unwrap().get("1").unwrap().get("pose").unwrap();
        assert_eq!(nested.numbers("T,3").unwrap().values, [0.0, 0.0, 0.0, 1.0, 1.0, 1.0]);
        assert_eq!(file.get("ordered").unwrap().keys().unwrap(), ["b", "a"], "{name}");
        assert_eq!(numbers("set", "1"), [7.0]);
        for matrix in ["csr", "coo"] {
            let rows = file.get(matrix).unwrap().rows().unwrap_or_else(|e| panic!("{name}: {e}"));
            let expected = Rows { shape: [2, 3], rows: vec![vec![(1, 2.0)], vec![(0, 1.0), (2, 3.0)]] };
            assert_eq!(rows, expected, "{name}");
            assert_eq!(numbers(matrix, "2,3"), [0.0, 2.0, 0.0, 1.0, 0.0, 3.0]);
        }
        if file.root().contains("ch") {
            assert_eq!(numbers("ch", "2"), [1.0, 2.0]);
        }
    }
}

#[test]
fn joblib_and_numpy_save_are_read() {
    for name in ["joblib.pkl", "joblib_python2.pkl"] {
        let person = read(name).get("1").unwrap().get("pose").map(|pose| pose.numbers("T,6").unwrap());
        assert_eq!(person.unwrap().values[6..], [0.5, 1.5, 2.5, 3.5, 4.5, 5.5], "{name}");
    }
    let file = read("alignments.npy");
    assert_eq!(file.root().keys().unwrap(), ["00000.png", "00001.png"]);
    assert_eq!(file.get("00001.png").unwrap().numbers("4,3").unwrap().values[11], 12.0);
}

#[test]
fn what_is_asked_for_and_not_there_is_named() {
    let file = read("python3_4.pkl");
    let message = |result: Result<f64, skinsplat_data::Error>| {
        let text = result.unwrap_err().to_string();
        assert!(
            text.starts_with(&small("python3_4.pkl").display().to_string()) && !text.contains('\n'),
            "{text}"
        );
        text.split(": ").skip(1).collect::<Vec<_>>().join(": ")
    };
    let number = |key: &str| message(file.get(key).and_then(|field| field.number()));
    assert!(
        number("focal").starts_with("focal: missing; there are camera_f, camera_t, "),
        "{}",
        number("focal")
    );
    assert_eq!(number("name"), "name: a string; expected an array of numbers");
    assert_eq!(number("table"), "table: a list of 2; expected a finite number");
    let deep = file.get("nested").unwrap().get("1").unwrap().get("pose").unwrap().items().unwrap()[1].clone();
    assert_eq!(
        message(deep.number()),
        "nested.1.pose[1]: a NumPy array of shape [3]; expected a finite number"
    );
    let other = file.get("rows").unwrap().numbers("T,3").map(|_| 0.0);
    assert_eq!(message(other), "rows: shape [2, 4]; expected (T,3) with T = 2");
}

#[test]
fn foreign_classes_and_calls_are_refused_by_name() {
    for (name, expected) in [
        ("foreign.pkl", "an object of __main__.Foreign, which is not read"),
        ("runs.pkl", "an object of builtins.print, which is not read"),
        ("joblib_zlib.pkl", "a pickle compressed with zlib, which is not read"),
    ] {
        let error = Pickle::read(&small(name), "values").unwrap_err();
        assert_eq!(error.field(), "pickle");
        assert!(error.to_string().contains(expected), "{error}");
    }
    for (bytes, expected) in [
        (&b"cos\nsystem\n(S'touch x'\ntR."[..], "an object of os.system"),
        (b"cposix\nsystem\n(S'id'\ntR.", "an object of posix.system"),
        (b"(S'ls'\nios\nsystem\n.", "an object of os.system"),
        (b"\x80\x04\x8c\x08builtins\x8c\x04eval\x93.", "an object of builtins.eval"),
        (b"cnumpy\nload\n.", "an object of numpy.load"),
        (b"cnumpy.core.multiarray\nfromstring\n.", "an object of numpy.core.multiarray.fromstring"),
        (b"c__builtin__\nint\n(S'1'\ntR.", "a call of a plain type"),
        (b"Pabc\n.", "a persistent id"),
        (b"\x80\x02]Q.", "a persistent id"),
        (b"\x80\x02\x82\x01.", "an extension code"),
        (b"\x80\x05\x97.", "a buffer outside the file"),
        (b"\x80\x09N.", "protocol 9"),
    ] {
        let text = refusal(bytes);
        assert!(text.contains(expected) && !text.contains('\n'), "{text}");
    }
}

#[test]
fn damaged_programs_are_errors() {
    for bytes in [
        &b""[..],
        b".",
        b"N",
        b"(.",
        b"t.",
        b"a.",
        b"h\x00.",
        b"\xff.",
        b"Inot a number\n.",
        b"S'unclosed\n.",
        b"]N\x86s.",
        b"}Na.",
        b"(Nd.",
        b"NR.",
        b"\x80\x04X\xff\xff\xff\xffabc.",
        b"\x80\x04\x8e\xff\xff\xff\xff\xff\xff\xff\xffabc.",
        b"Nb.",
    ] {
        let text = refusal(bytes);
        assert!(text.starts_with("x.pkl: pickle: ") && text.contains("expected"), "{bytes:?}: {text}");
    }
    // A file of every length short of its end.
    for name in ["python3_4.pkl", "python2_0.pkl", "joblib.pkl"] {
        let whole = std::fs::read(small(name)).unwrap();
        for length in 0..whole.len() {
            assert!(refusal(&whole[..length]).starts_with("x.pkl: pickle: "), "{name}, {length} bytes");
        }
    }
}

/// Every byte changed in turn: whatever comes out, nothing panics and nothing grows.
#[test]
fn changed_bytes_do_no_harm() {
    for name in ["python3_2.pkl", "python3_4.pkl", "python2_1.pkl", "joblib.pkl"] {
        let whole = std::fs::read(small(name)).unwrap();
        for at in 0..whole.len() {
            for change in [0x01, 0x80, 0xff] {
                let mut bytes = whole.clone();
                bytes[at] ^= change;
                let Ok(file) = Pickle::from_bytes(Path::new("x.pkl"), bytes) else { continue };
                for key in file.root().keys().unwrap_or_default() {
                    let Ok(field) = file.get(&key) else { continue };
                    let _ = (
                        field.array().is_ok(),
                        field.rows().is_ok(),
                        field.texts().is_ok(),
                        field.describe(),
                    );
                }
            }
        }
    }
}

#[test]
fn small_files_stay_small() {
    // A list of ten lists of ten lists, and so on: 10^12 numbers in 300 bytes.
    let mut laughs = b"\x80\x02]q\x00(K\x01K\x01K\x01K\x01K\x01K\x01K\x01K\x01K\x01K\x01e".to_vec();
    for level in 0..11u8 {
        laughs.extend([b'0', b']', b'q', level + 1, b'(']);
        for _ in 0..10 {
            laughs.extend([b'h', level]);
        }
        laughs.push(b'e');
    }
    laughs.push(b'.');
    let file = Pickle::from_bytes(Path::new("x.pkl"), laughs).unwrap();
    assert!(file.root().array().unwrap_err().to_string().contains("more values than the file has bytes"));
    // A list that holds itself, and a depth of 100,000.
    let file = Pickle::from_bytes(Path::new("x.pkl"), b"\x80\x02]q\x00h\x00a.".to_vec()).unwrap();
    assert!(file.root().array().is_err());
    let mut deep = vec![b'('; 100_000];
    deep.extend(vec![b'l'; 100_000]);
    deep.push(b'.');
    let file = Pickle::from_bytes(Path::new("x.pkl"), deep).unwrap();
    assert!(file.root().array().unwrap_err().to_string().contains("nested too deep"));
    // Bytes that are encoded anew a thousand times.
    let mut text = b"\x80\x02X\x00\x10\x00\x00".to_vec();
    text.extend([b'a'; 4096]);
    text.extend(b"q\x000c_codecs\nencode\nq\x010");
    for _ in 0..1000 {
        text.extend(b"h\x01h\x00X\x06\x00\x00\x00latin1\x86R0");
    }
    text.extend(b"N.");
    assert!(refusal(&text).contains("over and over"));
    // A sparse matrix of 2^40 rows.
    let sparse = b"ccopy_reg\n_reconstructor\n(cscipy.sparse.csr\ncsr_matrix\nc__builtin__\nobject\nNtR(dS'_shape'\n(L1099511627776L\nI3\ntsS'data'\n(lsS'indices'\n(lsS'indptr'\n(lI0\nasb.";
    let file = Pickle::from_bytes(Path::new("x.pkl"), sparse.to_vec()).unwrap();
    assert!(file.root().rows().is_err() && file.root().array().is_err());
}
