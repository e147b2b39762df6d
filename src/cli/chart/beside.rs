//! What other programs took: tables that are drawn beside the points of a chart.

use crate::{Error, Result};
use std::path::Path;

/// Points of another program.
pub struct Other {
    pub name: String,
    /// Seconds and relative RMSE, as they are in the file.
    pub places: Vec<[f64; 2]>,
}

/// Reads lines of `seconds,error`, a relative RMSE; lines that start with `#` and a heading are left out.
///
/// # Errors
/// `File` where it cannot be read, or a line is something else.
pub fn read(name: &str, path: &Path) -> Result<Other> {
    let help = "write a line for each point: seconds,error, as in 67.5,0.02";
    let text = std::fs::read_to_string(path).map_err(|error| Error::file(path, error.to_string(), help))?;
    let mut places = Vec::new();
    for (at, line) in text.lines().enumerate() {
        let is_heading = at == 0 && line.starts_with(|c: char| c.is_alphabetic());
        if is_heading || line.starts_with('#') || line.trim().is_empty() {
            continue;
        }
        let place = place(line).ok_or_else(|| {
            Error::file(path, format!("line {}: \"{line}\" is not two positive numbers", at + 1), help)
        })?;
        places.push(place);
    }
    if places.is_empty() {
        return Err(Error::file(path, "there is no point in it", help));
    }
    Ok(Other { name: name.to_owned(), places })
}

fn place(line: &str) -> Option<[f64; 2]> {
    let mut numbers = line.split(',').map(|number| number.trim().parse::<f64>());
    let place = [numbers.next()?.ok()?, numbers.next()?.ok()?];
    place.iter().all(|number| number.is_finite() && *number > 0.0).then_some(place)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_points() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        let read = |text: &str| {
            std::fs::write(&path, text).unwrap();
            read("other", &path).map(|other| other.places)
        };
        assert_eq!(read("seconds,error\n# note\n1.5,0.2\n\n3, 0.1,x\n").unwrap(), [[1.5, 0.2], [3.0, 0.1]]);
        assert!(["", "seconds,error\n", "1,0\n", "1\n", "1,a\n", "1,2\nx,y\n"].iter().all(|text| read(text).is_err()));
    }
}
