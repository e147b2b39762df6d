//! The disk cache: one file an entry, named by its key, so that processes can share a folder without talking.
//!
//! A file is written under a temporary name and renamed, so a reader sees all of it or nothing, and a killed writer
//! leaves a temporary file that a later process removes. Layout, little-endian: magic, version, number of sections,
//! key, then per section its length and BLAKE3 checksum, the checksum of all that, and the sections, each at a multiple
//! of 64 bytes. Sections are read straight into the memory that they end up in. When the folder grows over its bound,
//! the entries that have not been read for longest go (a read touches the modification time).

use crate::atomic::{self, TEMPORARY};
use crate::node::Key;
use crate::stored::{Section, SectionReader, SectionWriter, checksum};
use crate::{Error, Result};
use std::fs::{File, FileTimes};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

const MAGIC: &[u8; 8] = b"chiaro\0\n";
const VERSION: u32 = 1;
const FIXED: usize = 8 + 4 + 4 + 16;
const PER_SECTION: usize = 8 + 32;
const ALIGN: u64 = 64;
const SUFFIX: &str = "value";
/// A temporary file that nobody has written to for so long has lost its writer.
const STALE: Duration = Duration::from_secs(3600);

pub struct Disk {
    folder: PathBuf,
    bound: u64,
}

/// What became of a look into the cache.
#[derive(Debug, PartialEq)]
pub enum Found<T> {
    Value(T),
    Nothing,
    /// There is an entry, but it is not what was written.
    Damaged,
}

impl Disk {
    /// Opens a cache of at most `bound` bytes, and makes its folder if need be.
    ///
    /// # Errors
    /// `Output` when the folder cannot be made or read.
    pub fn open(folder: &Path, bound: u64) -> Result<Self> {
        let fail = |error: io::Error| {
            Error::output(folder, format!("the cache folder is of no use: {error}"), "--cache DIR or --no-cache")
        };
        std::fs::create_dir_all(folder).map_err(fail)?;
        let disk = Self { folder: folder.to_owned(), bound };
        disk.remove_stale(SystemTime::now()).map_err(fail)?;
        Ok(disk)
    }

    pub fn path(&self, key: Key) -> PathBuf {
        self.folder.join(format!("{key}.{SUFFIX}"))
    }

    pub fn contains(&self, key: Key) -> bool {
        self.path(key).is_file()
    }

    /// `read` must take every section.
    pub fn get<T>(&self, key: Key, read: impl FnOnce(&mut SectionReader) -> Option<T>) -> Found<T> {
        let Ok(mut file) = File::open(self.path(key)) else { return Found::Nothing };
        let Some(sections) = read_table(&mut file, key) else { return Found::Damaged };
        let mut reader = SectionReader::new(&mut file, &sections);
        match read(&mut reader) {
            Some(value) if reader.is_empty() => {
                // A cache that cannot be written to can still be read from.
                let _ = file.set_times(FileTimes::new().set_modified(SystemTime::now()));
                Found::Value(value)
            }
            _ => Found::Damaged,
        }
    }

    /// Keeps an entry, replacing one of the same key, and makes room for it. False: it is larger than the cache, and not
    /// kept.
    ///
    /// # Errors
    /// When the file cannot be written; what was there before is untouched.
    pub fn put(&self, key: Key, sections: &SectionWriter) -> io::Result<bool> {
        let table = write_table(key, sections);
        let content: u64 = sections.sections.iter().map(|section| aligned(section.len() as u64)).sum();
        let bytes = aligned(table.len() as u64) + content;
        if bytes > self.bound {
            tracing::debug!("{key} is not cached on disk: {bytes} bytes are more than the bound of {}", self.bound);
            return Ok(false);
        }
        atomic::replace(&self.path(key), |file| {
            let mut write = |part: &[u8]| {
                let padding = aligned(part.len() as u64) as usize - part.len();
                file.write_all(part)?;
                file.write_all(&[0; ALIGN as usize][..padding])
            };
            write(&table)?;
            sections.sections.iter().try_for_each(|section| write(section))
        })?;
        self.make_room()?;
        Ok(true)
    }

    /// The entries: when each was last used, its size and path.
    fn entries(&self) -> io::Result<Vec<(SystemTime, u64, PathBuf)>> {
        let mut entries = Vec::new();
        for file in std::fs::read_dir(&self.folder)?.flatten() {
            let path = file.path();
            // Another process may remove files meanwhile.
            if path.extension().is_some_and(|suffix| suffix == SUFFIX)
                && let Ok(about) = file.metadata()
                && let Ok(used) = about.modified()
            {
                entries.push((used, about.len(), path));
            }
        }
        Ok(entries)
    }

    fn make_room(&self) -> io::Result<()> {
        let mut entries = self.entries()?;
        let mut total: u64 = entries.iter().map(|(_, bytes, _)| bytes).sum();
        entries.sort();
        for (_, bytes, path) in entries {
            if total <= self.bound {
                break;
            }
            match std::fs::remove_file(&path) {
                Ok(()) => total -= bytes,
                Err(error) if error.kind() == io::ErrorKind::NotFound => total -= bytes,
                // In use by another process on a system that minds: the next one, then.
                Err(error) => tracing::debug!("{} stays in the cache: {error}", path.display()),
            }
        }
        Ok(())
    }

    fn remove_stale(&self, now: SystemTime) -> io::Result<()> {
        for file in std::fs::read_dir(&self.folder)?.flatten() {
            let abandoned = file.file_name().to_string_lossy().starts_with(TEMPORARY)
                && file
                    .metadata()
                    .and_then(|about| about.modified())
                    .is_ok_and(|written| now.duration_since(written).is_ok_and(|age| age > STALE));
            if abandoned {
                let _ = std::fs::remove_file(file.path());
            }
        }
        Ok(())
    }
}

fn aligned(bytes: u64) -> u64 {
    bytes.next_multiple_of(ALIGN)
}

fn write_table(key: Key, sections: &SectionWriter) -> Vec<u8> {
    let mut table = Vec::new();
    table.extend_from_slice(MAGIC);
    table.extend_from_slice(&VERSION.to_le_bytes());
    table.extend_from_slice(&(sections.sections.len() as u32).to_le_bytes());
    table.extend_from_slice(&key.0);
    for section in &sections.sections {
        table.extend_from_slice(&(section.len() as u64).to_le_bytes());
        table.extend_from_slice(&checksum(section));
    }
    let sum = checksum(&table);
    table.extend_from_slice(&sum);
    table
}

/// `None` when the file is not an entry of that key, or is damaged or cut short.
fn read_table(file: &mut File, key: Key) -> Option<Vec<Section>> {
    let length = file.metadata().ok()?.len();
    let mut table = vec![0; FIXED];
    file.read_exact(&mut table).ok()?;
    let count = u32::from_le_bytes(table[12..16].try_into().ok()?);
    let fits = table[..8] == *MAGIC && table[8..12] == VERSION.to_le_bytes() && table[16..FIXED] == key.0;
    let bytes = FIXED as u64 + u64::from(count) * PER_SECTION as u64;
    if !fits || bytes + 32 > length {
        return None;
    }
    table.resize(bytes as usize, 0);
    file.read_exact(&mut table[FIXED..]).ok()?;
    let mut sum = [0; 32];
    file.read_exact(&mut sum).ok()?;
    if checksum(&table) != sum {
        return None;
    }
    let mut offset = aligned(bytes + 32);
    let sections = table[FIXED..].chunks_exact(PER_SECTION).map(|entry| {
        let bytes = u64::from_le_bytes(entry[..8].try_into().ok()?);
        let section = Section { offset, bytes, checksum: entry[8..].try_into().ok()? };
        offset = offset.checked_add(bytes.checked_next_multiple_of(ALIGN)?)?;
        (section.offset.checked_add(bytes)? <= length).then_some(section)
    });
    sections.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(name: u8) -> Key {
        Key([name; 16])
    }

    fn put(disk: &Disk, name: u8, data: &[f32]) {
        let mut sections = SectionWriter::default();
        sections.value(&data.len());
        sections.slice(data);
        disk.put(key(name), &sections).unwrap();
    }

    fn get(disk: &Disk, name: u8) -> Found<Vec<f32>> {
        disk.get(key(name), |sections| {
            let length: usize = sections.value()?;
            sections.vec().filter(|data: &Vec<f32>| data.len() == length)
        })
    }

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> =
            std::fs::read_dir(folder).unwrap().map(|f| f.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn what_was_put_is_found() {
        let folder = tempfile::tempdir().unwrap();
        let disk = Disk::open(folder.path(), 1 << 20).unwrap();
        assert_eq!(get(&disk, 1), Found::Nothing);
        put(&disk, 1, &[1.0, -0.0, 3.5]);
        put(&disk, 2, &[]);
        assert_eq!(get(&disk, 1), Found::Value(vec![1.0, -0.0, 3.5]));
        assert_eq!(get(&disk, 2), Found::Value(vec![]));
        assert_eq!(names(folder.path()).len(), 2, "no temporary files stay");
    }

    /// Whatever single byte is changed, and wherever the file is cut, the entry is not taken for good.
    #[test]
    fn damage_anywhere_is_noticed() {
        let folder = tempfile::tempdir().unwrap();
        let disk = Disk::open(folder.path(), 1 << 20).unwrap();
        let data: Vec<f32> = (0..50).map(|x| x as f32).collect();
        put(&disk, 1, &data);
        let good = std::fs::read(disk.path(key(1))).unwrap();
        let table = FIXED + 2 * PER_SECTION + 32;
        let first = aligned(table as u64) as usize;
        let second = first + ALIGN as usize;
        let padding =
            |at: usize| (table..first).contains(&at) || (first + 2..second).contains(&at) || at >= second + 200;
        for at in 0..good.len() {
            let mut bad = good.clone();
            bad[at] ^= 0x10;
            std::fs::write(disk.path(key(1)), &bad).unwrap();
            let expected = if padding(at) { Found::Value(data.clone()) } else { Found::Damaged };
            assert_eq!(get(&disk, 1), expected, "byte {at}");
        }
        for length in (0..second + 200).step_by(7) {
            std::fs::write(disk.path(key(1)), &good[..length]).unwrap();
            assert_eq!(get(&disk, 1), Found::Damaged, "cut to {length}");
        }
        std::fs::write(disk.path(key(2)), &good).unwrap();
        assert_eq!(get(&disk, 2), Found::Damaged, "an entry under another key's name");
        put(&disk, 1, &data);
        assert_eq!(get(&disk, 1), Found::Value(data), "replaced");
    }

    /// Large arrays stay in their file: they outlive its removal, and damage is noticed as ever.
    #[test]
    fn large_arrays_are_mapped() {
        let folder = tempfile::tempdir().unwrap();
        let disk = Disk::open(folder.path(), 1 << 30).unwrap();
        let data: Vec<u32> =
            (0..(crate::stored::MAPPED / 4) as u32 + 5).map(|x| x.wrapping_mul(2_654_435_761)).collect();
        put(&disk, 1, bytemuck::cast_slice(&data));
        let array = || {
            disk.get(key(1), |sections| {
                sections.value::<usize>().and_then(|_| crate::device::Array::<u32>::read(sections))
            })
        };
        let Found::Value(found) = array() else { panic!("it was put") };
        assert!(found.is_mapped() && found.clone()[..] == data[..]);
        let before = std::fs::read(disk.path(key(1))).unwrap();
        let mut bad = before.clone();
        let at = before.len() - 100;
        bad[at] ^= 1;
        std::fs::remove_file(disk.path(key(1))).unwrap();
        assert!(found[..] == data[..]);
        std::fs::write(disk.path(key(1)), &bad).unwrap();
        assert!(matches!(array(), Found::Damaged));
    }

    #[test]
    fn the_entry_unread_for_longest_goes_first() {
        let folder = tempfile::tempdir().unwrap();
        let disk = Disk::open(folder.path(), 2000).unwrap();
        let age = |name: u8, seconds: u64| {
            let file = File::options().write(true).open(disk.path(key(name))).unwrap();
            file.set_modified(SystemTime::now() - Duration::from_secs(seconds)).unwrap();
        };
        for name in 1..=3 {
            put(&disk, name, &[0.5; 80]);
            age(name, 1000 - 100 * u64::from(name));
        }
        assert!(matches!(get(&disk, 1), Found::Value(_)), "read, so no longer the oldest");
        put(&disk, 4, &[0.5; 80]);
        assert_eq!([1, 2, 3, 4].map(|name| disk.contains(key(name))), [true, false, true, true]);
        put(&disk, 5, &[0.5; 8000]);
        assert!(!disk.contains(key(5)), "larger than the cache");
        assert!(disk.contains(key(4)));
    }

    #[test]
    fn temporary_files_of_a_killed_writer_go_when_they_are_old() {
        let folder = tempfile::tempdir().unwrap();
        for (name, hours) in [("old", 3), ("new", 0)] {
            let file = File::create(folder.path().join(format!("{TEMPORARY}{name}"))).unwrap();
            file.set_modified(SystemTime::now() - Duration::from_secs(hours * 3600)).unwrap();
        }
        Disk::open(folder.path(), 100).unwrap();
        assert_eq!(names(folder.path()), [format!("{TEMPORARY}new")]);
    }

    #[test]
    fn writers_of_the_same_key_do_not_meet() {
        let folder = tempfile::tempdir().unwrap();
        let data: Vec<f32> = (0..20_000).map(|x| x as f32).collect();
        std::thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| {
                    let disk = Disk::open(folder.path(), 1 << 20).unwrap();
                    for _ in 0..20 {
                        put(&disk, 1, &data);
                        assert_eq!(get(&disk, 1), Found::Value(data.clone()));
                    }
                });
            }
        });
        assert_eq!(names(folder.path()).len(), 1);
    }
}
