//! A chart as a table: CSV for programs, with every stage, and Markdown for people.

use super::Caches;
use super::measure::{Errors, Found, Point};
use super::settings::shown;
use super::spec::Spec;
use std::fmt::Write;

const MEBIBYTE: f64 = (1 << 20) as f64;

/// The names of all settings that are swept, each once.
fn swept(spec: &Spec) -> Vec<&str> {
    let mut names: Vec<&str> = Vec::new();
    for name in spec.products.iter().flat_map(|product| product.keys()) {
        if !names.contains(&name.as_str()) {
            names.push(name);
        }
    }
    names
}

/// One line a point: settings, seconds, bytes, errors, marks, then seconds and bytes of each node.
pub fn csv(spec: &Spec, found: &Found, fronts: &[[bool; 2]]) -> String {
    let names = swept(spec);
    let mut nodes: Vec<&str> = Vec::new();
    for stage in found.points.iter().flat_map(|point| &point.stages) {
        if !nodes.contains(&stage.node.as_str()) {
            nodes.push(&stage.node);
        }
    }
    let mut text = names.iter().map(|name| field(name) + ",").collect::<String>();
    text += "seconds_cold,seconds_warm,bytes,relative_rmse,relative_p99,ssim,relative_bias,stated_error,";
    text += "front_cold,front_warm,default";
    for node in &nodes {
        write!(text, ",seconds_cold {node},seconds_warm {node},bytes {node}").expect("a string");
    }
    for (point, front) in found.points.iter().zip(fronts) {
        text.push('\n');
        for name in &names {
            text += &(point.settings.get(*name).map_or_else(String::new, |value| field(&shown(value))) + ",");
        }
        let [cold, warm] = point.seconds;
        let Errors { rmse, p99, bias, ssim } = point.errors;
        let numbers = [Some(rmse), Some(p99), ssim, Some(bias), point.stated];
        let errors = numbers.map(|value| value.map_or_else(String::new, |value| value.to_string())).join(",");
        let marks = [front[0], front[1], spec.is_default(&point.settings)].map(|mark| u8::from(mark).to_string());
        write!(text, "{cold},{warm},{},{errors},{}", point.bytes(), marks.join(",")).expect("a string");
        for node in &nodes {
            match point.stages.iter().find(|stage| stage.node == *node) {
                Some(stage) => write!(text, ",{},{},{}", stage.seconds[0], stage.seconds[1], stage.bytes),
                None => write!(text, ",,,"),
            }
            .expect("a string");
        }
    }
    text.push('\n');
    text
}

/// RFC 4180.
fn field(text: &str) -> String {
    if text.contains([',', '"', '\n']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text.to_owned() }
}

/// Points on a front have bold seconds; the default has a star.
pub fn markdown(spec: &Spec, found: &Found, fronts: &[[bool; 2]]) -> String {
    let mut text = format!("**{}**", spec.title);
    let runs = if spec.runs == 1 { "one run".to_owned() } else { format!("median of {} runs", spec.runs) };
    let reference = &found.reference;
    write!(text, " — against {reference}; {}; {runs}.", found.devices.join(", ")).expect("a string");
    if !spec.why.is_empty() {
        write!(text, " The default (\u{2605}): {}", spec.why).expect("a string");
    }
    text += "\n\n|";
    let names = swept(spec);
    names.iter().for_each(|name| text += &format!(" {} |", name.replace('_', "\\_")));
    text += " cold s | warm s | MiB | error % | 99th % | bias % | SSIM | |\n|";
    text += &"---|".repeat(names.len());
    text += "--:|--:|--:|--:|--:|--:|--:|---|\n";
    for (point, front) in found.points.iter().zip(fronts) {
        text += "|";
        for name in &names {
            let value = point.settings.get(*name).map_or_else(String::new, shown);
            text += &format!(" {} |", value.replace('_', "\\_"));
        }
        text += &row(point, *front, spec.is_default(&point.settings));
    }
    text
}

fn row(point: &Point, front: [bool; 2], is_default: bool) -> String {
    let mut text = String::new();
    for caches in Caches::BOTH {
        let seconds = significant(point.seconds[caches as usize]);
        text += &if front[caches as usize] { format!(" **{seconds}** |") } else { format!(" {seconds} |") };
    }
    text += &format!(" {} |", significant(point.bytes() as f64 / MEBIBYTE));
    let errors = &point.errors;
    text += &format!(" {} | {} |", significant(100.0 * errors.rmse), significant(100.0 * errors.p99));
    text += &format!(" {:+.2} |", 100.0 * errors.bias);
    text += &errors.ssim.map_or_else(|| " |".to_owned(), |ssim| format!(" {ssim:.4} |"));
    text += if is_default { " \u{2605} |\n" } else { " |\n" };
    text
}

/// Three significant digits.
pub fn significant(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value:.0}");
    }
    let digits = (2 - value.abs().log10().floor() as i32).max(0) as usize;
    let text = format!("{value:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_digits() {
        let shown = [0.0, 0.012_345, 1.0, 1.999_9, 12.34, 123.4, 12_345.6].map(significant);
        assert_eq!(shown, ["0", "0.0123", "1", "2", "12.3", "123", "12346"]);
        assert_eq!([field("a"), field("a,b"), field("a\"b")], ["a", "\"a,b\"", "\"a\"\"b\""]);
    }
}
