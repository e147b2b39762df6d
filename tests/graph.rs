//! Recipes that must be taken and recipes that must be refused, with all that is wrong said at the right place.

mod trial_nodes;

use chiaro::Error;
use chiaro::graph::{self, Checks, Document, Param, Plan, Problem, schema::recipe_schema};
use serde_json::json;
use std::path::{Path, PathBuf};
use trial_nodes::NODES;

fn corpus(folder: &str) -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/corpus").join(folder);
    let files = std::fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path());
    let mut recipes: Vec<PathBuf> = files.filter(|path| path.extension().is_some_and(|ext| ext == "json")).collect();
    recipes.sort();
    assert!(recipes.len() >= 3, "nothing to try in {}", folder.display());
    recipes
}

fn plan(text: &str) -> chiaro::Result<Plan> {
    Plan::new(&Document::parse(Path::new("test.json"), text)?, NODES)
}

fn problems(text: &str) -> Vec<Problem> {
    match plan(text).err().expect("something is wrong with it") {
        Error::Graph { problems, .. } => problems,
        other => panic!("{other}"),
    }
}

/// The stretch of text that a problem points at.
fn pointed<'a>(text: &'a str, problem: &Problem) -> &'a str {
    &text[problem.place.clone().expect("a place").range]
}

#[test]
fn valid_recipes_are_planned_and_written_back() {
    for path in corpus("valid") {
        let document = graph::load(&path).unwrap();
        let plan = Plan::new(&document, NODES).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        for (index, step) in plan.steps.iter().enumerate() {
            assert!(step.inputs.iter().flatten().all(|wire| wire.step < index), "{}", path.display());
        }
        let again = Document::parse(&path, &document.to_text()).unwrap();
        assert_eq!(again.to_json().to_string(), document.to_json().to_string(), "{}", path.display());
    }
}

/// Beside each invalid recipe lies a text: one line a problem, `LINE:COLUMN: message (help)`, in order.
/// `CHIARO_BLESS=1` writes these texts anew, to be read before they are committed.
#[test]
fn invalid_recipes_are_refused_with_all_their_problems() {
    for path in corpus("invalid") {
        let error = graph::load(&path).and_then(|document| Plan::new(&document, NODES)).err();
        let error = error.unwrap_or_else(|| panic!("{} was taken", path.display()));
        assert_eq!(error.exit_code(), 2, "{}", path.display());
        if std::env::var_os("CHIARO_BLESS").is_some() {
            std::fs::write(path.with_extension("txt"), format!("{error}\n")).unwrap();
        }
        let expected = std::fs::read_to_string(path.with_extension("txt")).unwrap_or_default();
        assert_eq!(error.to_string().trim(), expected.trim(), "{}", path.display());
    }
}

#[test]
fn the_schema_takes_what_the_plan_takes() {
    let schema = recipe_schema(NODES);
    let validator = jsonschema::draft202012::new(&schema).unwrap();
    for path in corpus("valid") {
        let recipe = serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
        let errors: Vec<String> = validator.iter_errors(&recipe).map(|error| error.to_string()).collect();
        assert!(errors.is_empty(), "{}: {errors:?}", path.display());
    }
    for wrong in [
        json!({"chiaro": 1, "nodes": {"a": {"type": "flat", "params": {"width": 0}}}}),
        json!({"chiaro": 1, "nodes": {"a": {"type": "flat", "params": {"widht": 1}}}}),
        json!({"chiaro": 1, "nodes": {"a": {"type": "flta"}}}),
        json!({"chiaro": 1, "nodes": {"a": {"type": "gain"}}}),
        json!({"chiaro": 2, "nodes": {}}),
        json!({"chiaro": 1, "nodes": {"a b": {"type": "flat"}}}),
    ] {
        assert!(!validator.is_valid(&wrong), "{wrong}");
    }
}

#[test]
fn a_problem_points_at_what_is_wrong() {
    let text = r#"{ "chiaro": 1, "nodes": {
        "base": { "type": "flat", "params": { "value": 11, "widht": 3, "mode": "strped",
            "dots": [{ "radius": 1 }, { "radius": -1 }], "tint": [1, "x", 2] } },
        "lit": { "type": "gain", "inputs": { "image": "bsae", "imge": "base" } },
        "set": { "type": "stage" },
        "out": { "type": "dump", "inputs": { "image": "set" } }
    } }"#;
    let found = problems(text);
    let pointed: Vec<&str> = found.iter().map(|problem| pointed(text, problem)).collect();
    assert_eq!(pointed, ["11", "\"widht\"", "\"strped\"", "-1", "\"x\"", "\"bsae\"", "\"imge\"", "\"set\""]);
    for (problem, (message, help)) in found.iter().zip([
        ("11 is too large", "10"),
        ("flat has no parameter \"widht\"", "\"width\""),
        ("not one of the choices", "\"striped\""),
        ("too small", "0"),
        ("expected a number", ""),
        ("no node \"bsae\"", "did you mean \"base\"?"),
        ("gain has no input \"imge\"", "\"image\""),
        ("takes image, but \"set\" gives scene", "\"base\""),
    ]) {
        assert!(problem.message.contains(message), "{problem}");
        assert!(problem.help.contains(help), "{problem}");
    }
}

#[test]
fn loops_are_named() {
    let found = problems(
        r#"{ "chiaro": 1, "nodes": {
            "self": { "type": "gain", "inputs": { "image": "self" } },
            "a": { "type": "gain", "inputs": { "image": "c" } },
            "b": { "type": "gain", "inputs": { "image": "a" } },
            "c": { "type": "add", "inputs": { "a": "fine", "b": "b" } },
            "fine": { "type": "flat" },
            "after": { "type": "gain", "inputs": { "image": "c" } }
        } }"#,
    );
    let messages: Vec<&str> = found.iter().map(|problem| problem.message.as_str()).collect();
    assert_eq!(messages.len(), 2, "{messages:?}");
    assert!(messages[0].ends_with("self -> self"), "{messages:?}");
    assert!(
        ["a -> b -> c -> a", "b -> c -> a -> b", "c -> a -> b -> c"].iter().any(|ring| messages[1].ends_with(ring))
    );
}

#[test]
fn curves_are_checked_key_by_key_and_round_where_integers_are_asked_for() {
    let with = |curve: &str| format!(r#"{{"chiaro": 1, "nodes": {{"a": {{"type": "flat", "params": {{{curve}}}}}}}}}"#);
    let good = plan(&with(r#""width": {"keys": [[1, 1], [4, 2]]}, "groups": {"keys": ["a"]}"#)).unwrap();
    let width = |frame| good.steps[0].node(frame).unwrap().node.params()["width"].clone();
    assert_eq!([1.0, 2.0, 3.0].map(width), [json!(1), json!(1), json!(2)]);
    assert!(
        matches!(good.steps[0].params.get("groups"), Some(Param::Constant(_))),
        "a value that happens to look like a curve"
    );
    let text = with(r#""value": {"keys": [[1, 1], [2, 99], [3, "x"]]}, "mode": {"keys": [[1, "plain"]]}"#);
    let found = problems(&text);
    assert_eq!(
        found.iter().map(|problem| pointed(&text, problem)).collect::<Vec<_>>(),
        ["[3, \"x\"]", "[1, \"plain\"]"]
    );
    let text = with(r#""value": {"keys": [[1, 1], [2, 99]]}"#);
    assert_eq!(pointed(&text, &problems(&text)[0]), "99");
}

#[test]
fn numbers_that_do_not_fit_are_refused() {
    for (params, message) in [
        (r#""scale": 1e39"#, "too large for a 32-bit number"),
        (r#""tint": [0, 0, 1e200]"#, "too large for a 32-bit number"),
        (r#""scale": 0"#, "too small"),
        (r#""width": 2.5"#, "expected an integer"),
        (r#""width": -3"#, "too small"),
        (r#""limit": "x""#, "expected a number"),
        (r#""tint": [1, 2]"#, "too short"),
        (r#""dots": [{"radius": 1, "size": 2}]"#, "unknown field \"size\""),
        (r#""dots": [{}]"#, "\"radius\" is missing"),
        (r#""mode": 3"#, "3"),
    ] {
        let text = format!(r#"{{"chiaro": 1, "nodes": {{"a": {{"type": "flat", "params": {{{params}}}}}}}}}"#);
        let found = problems(&text);
        assert_eq!(found.len(), 1, "{params}: {found:?}");
        assert!(found[0].message.contains(message), "{params}: {}", found[0]);
    }
}

#[test]
fn overrides_of_the_command_line_are_usage_errors() {
    let text = r#"{"chiaro": 1, "nodes": {"a": {"type": "flat", "params": {"value": 50}}}}"#;
    let set = |arguments: &[&str]| {
        let mut document = Document::parse(Path::new("test.json"), text).unwrap();
        arguments.iter().for_each(|argument| document.set(argument).unwrap());
        Plan::new(&document, NODES)
    };
    let good = set(&["a.value=2", "a.width=3"]).unwrap();
    assert_eq!(good.steps[0].node(1.0).unwrap().node.params()["value"], json!(2.0));
    assert!(good.recipe().contains("\"value\": 2"), "the headers of pictures tell what was rendered");
    let error = set(&["a.value=-2", "a.widht=3"]).err().unwrap();
    assert!(matches!(error, Error::Usage { .. }));
    let message = error.to_string();
    assert!(message.contains("--set a.value=-2: ") && message.contains("did you mean \"width\"?"), "{message}");
    assert!(matches!(set(&["a.width=0"]).err().unwrap(), Error::Graph { problems, .. } if problems.len() == 2));
}

#[test]
fn targets_are_the_writers_or_what_is_named() {
    let plan =
        plan(r#"{"chiaro": 1, "nodes": {"out": {"type": "dump", "inputs": {"image": "a"}}, "a": {"type": "flat"}}}"#)
            .unwrap();
    assert_eq!(plan.targets(&[]).unwrap(), [1]);
    assert_eq!(plan.targets(&["a".into()]).unwrap(), [0]);
    assert!(plan.targets(&["ot".into()]).unwrap_err().help().contains("out"));
    let none = self::plan(r#"{"chiaro": 1, "nodes": {"a": {"type": "flat"}}}"#).unwrap();
    assert_eq!(none.targets(&[]).unwrap_err().exit_code(), 2);
}

/// What is muted is passed by, in every way that wires can lead past it.
#[test]
fn muted_nodes_are_passed_by() {
    let recipe = |muted: [bool; 3], scene_of_wall: &str| {
        let text = serde_json::json!({ "chiaro": 1, "nodes": {
            "room": { "type": "scene", "params": { "file": "builtin:room" } },
            "red": { "type": "material", "inputs": { "scene": "room" }, "muted": muted[0] },
            "blue": { "type": "material", "inputs": { "scene": "red" }, "muted": muted[1] },
            "wall": { "type": "pick", "inputs": { "scene": scene_of_wall } },
            "brush": { "type": "source_brush", "inputs": { "selection": "wall" }, "muted": muted[2] },
            "more": { "type": "source_brush", "inputs": { "selection": "wall", "edits": "brush" } },
        }});
        Document::parse(Path::new("test.json"), &text.to_string()).unwrap()
    };
    let source = |plan: &Plan, node: &str, port: usize| {
        let step = &plan.steps[plan.find(node).unwrap()];
        step.inputs[port].map(|wire| plan.steps[wire.step].name.clone())
    };
    let plan = |muted| Plan::new(&recipe(muted, "blue"), chiaro::nodes::ALL).unwrap();
    assert_eq!(source(&plan([false; 3]), "wall", 0).as_deref(), Some("blue"));
    assert_eq!(source(&plan([false, true, false]), "wall", 0).as_deref(), Some("red"));
    assert_eq!(source(&plan([true, true, false]), "wall", 0).as_deref(), Some("room"));
    // An optional input of what passes nothing on is not connected.
    let muted = plan([false, false, true]);
    let more = &muted.steps[muted.find("more").unwrap()];
    let port = more.node_type.info.inputs.iter().position(|port| port.name == "edits").unwrap();
    assert_eq!(more.inputs[port], None);
    assert!(muted.targets(&["brush".to_owned()]).unwrap_err().to_string().contains("muted"));
    // A required one is a problem, with its place.
    let mut document = recipe([false; 3], "room");
    document.entry_mut("room").unwrap().muted = true;
    let error = Plan::new(&document, chiaro::nodes::ALL).err().unwrap();
    assert!(error.to_string().contains("takes from \"room\", which is muted"), "{error}");
    // And it is part of the recipe.
    let written = recipe([true, false, false], "red").to_text();
    assert!(written.contains("\"muted\": true") && !written.contains("\"muted\": false"), "{written}");
}

/// A recipe that changes step by step is found right or wrong as if it had just been read, and makes the same nodes.
#[test]
fn plans_of_a_recipe_that_changes_are_those_of_what_it_has_become() {
    let text = r#"{ "chiaro": 1, "frames": [1, 9], "nodes": {
        "a": { "type": "flat", "params": { "value": { "keys": [[1, 0.5], [9, 0.75]] } } },
        "b": { "type": "flat", "params": { "width": 3 } },
        "sum": { "type": "add", "inputs": { "a": "a", "b": "b" } }
    } }"#;
    let mut document = Document::parse(Path::new("test.json"), text).unwrap();
    let mut checks = Checks::default();
    let (mut wrong, mut right) = (0, 0);
    for step in 0..12 {
        match step {
            1 => document.set_param("b", "width", Some(json!(5))),
            2 | 3 => document.set_param("b", "value", Some(json!(-2 * step))),
            4 => document.set_param("a", "value", Some(json!(0.25))),
            5 => document.frames = [3, 9],
            6 => document.set_param("b", "value", None),
            7 => document.rename("b", "c").unwrap(),
            8 => document.rename("a", "b").unwrap(),
            9 => document.entry_mut("c").unwrap().kind = "add".to_owned(),
            10 => document.entry_mut("c").unwrap().kind = "flat".to_owned(),
            _ => {}
        }
        document = document.refreshed().unwrap();
        let again = Plan::again(&document, NODES, &mut checks);
        match (again, Plan::new(&document, NODES)) {
            (Ok(again), Ok(new)) => {
                right += 1;
                for (again, new) in again.steps.iter().zip(&new.steps) {
                    let digest = |step: &chiaro::graph::Step, frame| step.node(frame).unwrap().digest;
                    assert_eq!((&again.name, &again.inputs), (&new.name, &new.inputs), "step {step}");
                    for frame in [3.0, 6.0] {
                        assert_eq!(digest(again, frame), digest(new, frame), "step {step}: {}", new.name);
                    }
                }
            }
            (Err(again), Err(new)) => {
                wrong += 1;
                assert_eq!(again.to_string(), new.to_string(), "step {step}");
            }
            _ => panic!("step {step}: right for one, wrong for the other"),
        }
    }
    assert!(wrong >= 3 && right >= 3, "{wrong} wrong, {right} right");
}
