//! Where the real data lies that tests may use, and how they say that it is not there.

use std::path::PathBuf;

/// A file or folder of the real data: in `$CHIARO_DATA`, or in `../shared/data` beside the repository.
pub fn data(path: &str) -> Option<PathBuf> {
    let root = match std::env::var_os("CHIARO_DATA") {
        Some(root) => PathBuf::from(root),
        None => PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared/data"),
    };
    Some(root.join(path)).filter(|path| path.exists())
}

/// The data files that are there; says loudly, past the test runner's capture, how many are not.
pub fn all_data(test: &str, paths: &[&str]) -> Vec<PathBuf> {
    use std::io::Write;
    let found: Vec<PathBuf> = paths.iter().filter_map(|path| data(path)).collect();
    let missing = paths.len() - found.len();
    if missing > 0 {
        let _ = writeln!(
            std::io::stderr(),
            "\nSKIPPED: {test}: {missing} of {} data files are not there (set CHIARO_DATA or put them in ../shared/data)",
            paths.len()
        );
    }
    found
}
