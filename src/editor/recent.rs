//! The recipes that were opened last.

use crate::{Result, atomic};
use std::path::{Path, PathBuf};

/// Names that are kept.
const MOST: usize = 12;

pub struct Recent {
    list: PathBuf,
    files: Vec<PathBuf>,
}

impl Recent {
    /// As `list`, a file of one path a line, has it; empty when there is none.
    pub fn read(list: &Path) -> Self {
        let text = std::fs::read_to_string(list).unwrap_or_default();
        let files = text.lines().filter(|line| !line.is_empty()).map(PathBuf::from).take(MOST).collect();
        Self { list: list.to_owned(), files }
    }

    /// The last first.
    pub fn files(&self) -> &[PathBuf] {
        &self.files
    }

    /// A recipe was opened or saved.
    ///
    /// # Errors
    /// `Output` when the list cannot be written.
    pub fn note(&mut self, file: &Path) -> Result<()> {
        let file = std::path::absolute(file).unwrap_or_else(|_| file.to_owned());
        self.files.retain(|other| *other != file);
        self.files.insert(0, file);
        self.files.truncate(MOST);
        self.write()
    }

    /// A recipe is no longer there.
    ///
    /// # Errors
    /// `Output` when the list cannot be written.
    pub fn forget(&mut self, file: &Path) -> Result<()> {
        self.files.retain(|other| other != file);
        self.write()
    }

    fn write(&self) -> Result<()> {
        let text: String = self.files.iter().map(|file| format!("{}\n", file.display())).collect();
        if let Some(folder) = self.list.parent() {
            let _ = std::fs::create_dir_all(folder);
        }
        atomic::write(&self.list, text.as_bytes())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_comes_first_and_each_once() {
        let folder = tempfile::tempdir().unwrap();
        let list = folder.path().join("made/recent");
        let mut recent = Recent::read(&list);
        for name in ["/a", "/b", "/c", "/a"] {
            recent.note(Path::new(name)).unwrap();
        }
        let names = |recent: &Recent| recent.files().iter().map(|f| f.display().to_string()).collect::<Vec<_>>();
        assert_eq!(names(&Recent::read(&list)), ["/a", "/c", "/b"]);
        recent.forget(Path::new("/c")).unwrap();
        assert_eq!(names(&Recent::read(&list)), ["/a", "/b"]);
        (0..30).for_each(|i| recent.note(Path::new(&format!("/{i}"))).unwrap());
        assert_eq!(Recent::read(&list).files().len(), MOST);
    }
}
