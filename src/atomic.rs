//! Files that are there whole or not at all: written under a temporary name in the same folder, then renamed.

use crate::{Error, Result};
use std::collections::BTreeSet;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

/// Temporary names start so; a killed writer leaves one behind.
pub const TEMPORARY: &str = ".chiaro-writing-";

/// Writes a file through `fill`; what was there before stays untouched until all is written.
///
/// # Errors
/// That of `fill`, or of the file system.
pub fn replace(path: &Path, fill: impl FnOnce(&mut File) -> io::Result<()>) -> io::Result<()> {
    let folder = path.parent().filter(|folder| *folder != Path::new("")).unwrap_or(Path::new("."));
    sweep(folder);
    let mut builder = tempfile::Builder::new();
    builder.prefix(TEMPORARY);
    // Temporary files are private unless told otherwise; this one is to become an ordinary file.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut file = builder.tempfile_in(folder)?;
    // Between its making and its lock another process may have taken it for abandoned.
    while file.as_file().lock().is_ok() && !file.path().exists() {
        file = builder.tempfile_in(folder)?;
    }
    fill(file.as_file_mut())?;
    file.persist(path).map_err(|error| error.error)?;
    Ok(())
}

/// Removes what killed writers left in a folder, once for each process. A writer that lives holds a lock on its file; where
/// the file system knows no locks, nothing is removed.
fn sweep(folder: &Path) {
    static SWEPT: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());
    if !SWEPT.lock().expect("no panic while noting a folder").insert(folder.to_owned()) {
        return;
    }
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    for entry in entries.flatten().filter(|entry| entry.file_name().to_string_lossy().starts_with(TEMPORARY)) {
        let path = entry.path();
        // Locked until it is gone, so that its writer, should it be alive, notices.
        if let Ok(file) = File::options().write(true).open(&path)
            && file.try_lock().is_ok()
        {
            let _ = std::fs::remove_file(&path);
        }
    }
}

/// Writes a file that is already in memory.
///
/// # Errors
/// `Output`.
pub fn write(path: &Path, content: &[u8]) -> Result<()> {
    replace(path, |file| io::Write::write_all(file, content))
        .map_err(|error| Error::output(path, error.to_string(), "check that the folder exists and can be written to"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    #[test]
    fn a_failed_write_leaves_what_was_there() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        write(&path, b"before").unwrap();
        let failed = replace(&path, |file| {
            file.write_all(b"half")?;
            Err(io::Error::other("no more"))
        });
        assert!(failed.is_err());
        assert_eq!(std::fs::read(&path).unwrap(), b"before");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        assert_eq!(write(&folder.path().join("none/a"), b"").unwrap_err().exit_code(), 1);
    }

    #[test]
    fn what_a_killed_writer_left_goes_and_what_another_writes_stays() {
        let folder = tempfile::tempdir().unwrap();
        let [left, living] = ["left", "living"].map(|name| folder.path().join(format!("{TEMPORARY}{name}")));
        let [_, writer] = [&left, &living].map(|path| File::create(path).unwrap());
        writer.lock().unwrap();
        write(&folder.path().join("a"), b"").unwrap();
        assert!(!left.exists() && living.exists());
    }

    #[cfg(unix)]
    #[test]
    fn others_can_read_it_as_far_as_the_umask_lets_them() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let [ours, plain] = ["a", "b"].map(|name| folder.path().join(name));
        write(&ours, b"").unwrap();
        std::fs::write(&plain, b"").unwrap();
        let mode = |path: &Path| std::fs::metadata(path).unwrap().permissions().mode();
        assert_eq!(mode(&ours), mode(&plain));
    }
}
