//! Other people's programs from PyPI, as tests find them.

use std::io::Write;
use std::process::{Command, Output};

/// What runs Python with all of `modules`: `python3`, or `$CHIARO_PYTHON`. Says loudly, past the test runner's capture, what a
/// test is skipped for.
pub fn with(test: &str, modules: &[&str]) -> Option<impl Fn(&[&str]) -> Output> {
    let python = std::env::var("CHIARO_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let has = "import importlib.util, sys; print(*[m for m in sys.argv[1:] if not importlib.util.find_spec(m)])";
    let asked = Command::new(&python).args(["-c", has]).args(modules).output();
    let missing = match asked.ok().filter(|output| output.status.success()) {
        Some(output) => String::from_utf8_lossy(&output.stdout).trim().to_owned(),
        None => modules.join(" "),
    };
    if !missing.is_empty() {
        let _ = writeln!(
            std::io::stderr(),
            "\nSKIPPED: {test}: {python} has no {missing} (pip install, or set CHIARO_PYTHON)"
        );
        return None;
    }
    Some(move |arguments: &[&str]| Command::new(&python).args(arguments).output().unwrap())
}

/// What a program that succeeds said.
pub fn said(output: Output) -> String {
    let text = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned()).join("\n");
    assert!(output.status.success(), "{text}");
    text
}
