//! Which body template a table takes: the subject's, or the one that its method takes for everybody.

use crate::args;
use crate::program::{Desk, copy};
use crate::support::data;
use serde_json::Value;

/// A desk with a woman in PeopleSnapshot's layout, templates of both genders, and a table.
fn desk(model: &str) -> Desk {
    let desk = Desk::new();
    copy(&data("small/layouts/peoplesnapshot/ava"), &desk.path("people/female-3"));
    // The folder's name tells the gender.
    std::fs::remove_file(desk.path("people/female-3/config.json")).unwrap();
    let body = std::fs::read(data("blender/models/anny_smpl24.npz")).unwrap();
    for name in ["SMPL_FEMALE.npz", "SMPL_MALE.npz"] {
        desk.put(&format!("models/{name}"), &body);
    }
    desk.put(
        "sets.toml",
        format!(
            "[[dataset]]\nid = \"peoplesnapshot\"\ntitle = \"P\"\nlayout = \"peoplesnapshot\"\ncapture = \"monocular\"\n\
             licence = \"CC0-1.0\"\nprovenance = \"here\"\npath = \"people\"\nsubjects = [\"female-3\"]\nmodel = \"{model}\"\n\
             [dataset.splits]\nfemale-3 = {{ train = [0, 5, 1], test = [6, 7, 1] }}\n"
        ),
    );
    let text = include_str!("small.toml").replace("dataset = \"tiny\"", "dataset = \"peoplesnapshot\"");
    desk.put("small.toml", &text);
    let male = text.replace("id = \"small\"", "id = \"males\"");
    desk.put("males.toml", male.replace("layout = ", "genders = { \"female-3\" = \"male\" }\nlayout = "));
    desk
}

fn plan(desk: &Desk, tables: &[&str]) -> Value {
    let mut arguments = args!["plan"];
    arguments.extend(tables.iter().map(std::ffi::OsString::from));
    arguments.extend(args!["--datasets", "sets.toml", "--variant", "surface", "--format", "json"]);
    serde_json::from_str(&desk.ok(arguments)).unwrap()
}

fn notes(plan: &Value, table: usize) -> String {
    plan["tables"][table]["data_notes"].to_string()
}

#[test]
fn a_table_may_take_another_template_than_the_subjects() {
    let desk = desk("models");
    let both = plan(&desk, &["small.toml", "males.toml"]);
    assert!(!notes(&both, 0).contains("the table asks"), "{}", notes(&both, 0));
    let said = notes(&both, 1);
    assert!(
        said.contains("SMPL_MALE.npz: the male body, as the table asks; the subject is female"),
        "{said}"
    );
    // The same numbers of both templates are the same numbers: names of files and tables enter no key.
    let key = |table: usize| {
        let jobs = both["jobs"].as_array().unwrap().iter().filter(|job| job["table"] == table);
        jobs.map(|job| job["variants"][0]["key"].clone()).collect::<Vec<_>>()
    };
    assert!(!key(0).is_empty());
    assert_eq!(key(0), key(1));
    for table in 0..2 {
        assert_eq!(both["tables"][table]["rows"][0]["id"], "peoplesnapshot/female-3/test", "{both}");
        assert_eq!(both["tables"][table]["datasets"][0][0], "peoplesnapshot");
    }
}

#[test]
fn a_model_file_of_the_registry_goes_before_the_table() {
    let desk = desk("models/SMPL_FEMALE.npz");
    let said = notes(&plan(&desk, &["males.toml"]), 0);
    assert!(
        said.contains("a female body, which the registry gives; the table asks for the male one"),
        "{said}"
    );
}

#[test]
fn genders_of_strangers_are_refused() {
    let desk = desk("models");
    let text = desk.read("males.toml").replace("layout = ", "sequences = [\"someone\"]\nlayout = ");
    let text: Vec<&str> = text.lines().filter(|line| !line.starts_with("sequences = [\"tiny\"")).collect();
    desk.put("males.toml", text.join("\n"));
    desk.run(args!["plan", "males.toml", "--datasets", "sets.toml"])
        .refuses(&["males.toml", "genders", "female-3", "sequences"], "a stranger");
}
