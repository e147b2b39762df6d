//! Points that belong together: those that differ in their last setting alone.

use super::measure::Point;
use super::settings::{Settings, shown};

/// Points that are joined by a line.
pub struct Series {
    /// The settings that they share; empty when there is one series.
    pub label: String,
    /// What parts them, as in `tolerance`.
    pub swept: String,
    /// Positions in the list of points.
    pub points: Vec<usize>,
}

impl Series {
    /// What a legend calls it.
    pub fn title(&self) -> String {
        match (self.label.as_str(), self.swept.as_str()) {
            ("", swept) => swept.to_owned(),
            (label, swept) => format!("{label}, by {swept}"),
        }
    }
}

pub fn series(points: &[Point]) -> Vec<Series> {
    let mut all: Vec<(Settings, Series)> = Vec::new();
    for (at, point) in points.iter().enumerate() {
        let mut shared = point.settings.clone();
        let (swept, _) = shared.pop().expect("a product has settings");
        match all.iter_mut().find(|(settings, series)| *settings == shared && series.swept == param(&swept)) {
            Some((_, series)) => series.points.push(at),
            None => {
                let values: Vec<String> = shared.iter().map(|(name, value)| named(name, shown(value))).collect();
                let series = Series { label: values.join(", "), swept: param(&swept).to_owned(), points: vec![at] };
                all.push((shared, series));
            }
        }
    }
    all.into_iter().map(|(_, series)| series).collect()
}

/// The name of a parameter without its node's.
fn param(setting: &str) -> &str {
    setting.split_once('.').map_or(setting, |(_, param)| param)
}

/// Words speak for themselves, numbers need their name.
fn named(setting: &str, value: String) -> String {
    let is_word = value.starts_with(|c: char| c.is_alphabetic()) && value != "true" && value != "false";
    if is_word { value } else { format!("{} {value}", param(setting)) }
}

/// What parts a point from the others of its series.
pub fn value(point: &Point) -> String {
    point.settings.last().map_or_else(String::new, |(_, value)| shown(value))
}

#[cfg(test)]
mod tests {
    use super::super::measure::Errors;
    use super::*;
    use serde_json::json;

    #[test]
    fn points_that_differ_in_the_last_setting_are_joined() {
        let point = |list: &[(&str, serde_json::Value)]| Point {
            settings: list.iter().map(|(name, value)| ((*name).to_owned(), value.clone())).collect(),
            seconds: [1.0; 2],
            stages: Vec::new(),
            errors: Errors { rmse: 0.0, p99: 0.0, bias: 0.0, ssim: None },
            stated: None,
        };
        let points = [
            point(&[("v.basis", json!("haar1d")), ("v.size", json!(32)), ("v.n", json!(50))]),
            point(&[("v.basis", json!("haar1d")), ("v.size", json!(32)), ("v.n", json!(99))]),
            point(&[("v.basis", json!("haar2d")), ("v.size", json!(32)), ("v.n", json!(50))]),
            point(&[("v.basis", json!("runs")), ("v.size", json!(32))]),
        ];
        let found = series(&points);
        let told: Vec<_> = found.iter().map(|s| (s.label.as_str(), s.swept.as_str(), &s.points[..])).collect();
        assert_eq!(
            told,
            [("haar1d, size 32", "n", &[0, 1][..]), ("haar2d, size 32", "n", &[2][..]), ("runs", "size", &[3][..])]
        );
        assert_eq!(value(&points[1]), "99");
    }
}
