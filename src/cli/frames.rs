//! Lists of frames: `1-10`, `1-10x2`, `1-10:2`, `1..10`, `7,9`, negative numbers; and what part of a list is ours.

use crate::memo::Part;
use crate::{Error, Result};

/// More is a slip of the keyboard.
const MOST: i128 = 1_000_000;

/// The frames in the order given, each once.
///
/// # Errors
/// `Usage`.
pub fn parse_frames(text: &str) -> Result<Vec<i64>> {
    let mut frames = Vec::new();
    for item in text.split(',') {
        let (first, last, step) = parse_item(item.trim()).ok_or_else(|| {
            let help = "write frames as in 1-10, 1-10x2, 1-10:2, 1..10 or 7,9";
            Error::usage(format!("\"{item}\" is not a frame or a range of frames"), help)
        })?;
        if last < first {
            let message = format!("\"{item}\" ends before it starts");
            return Err(Error::usage(message, format!("write {last}-{first}")));
        }
        if (i128::from(last) - i128::from(first)) / i128::from(step) + frames.len() as i128 >= MOST {
            return Err(Error::usage(format!("\"{text}\" names too many frames"), format!("at most {MOST}")));
        }
        let mut frame = Some(first);
        while let Some(next) = frame.filter(|frame| *frame <= last) {
            frames.push(next);
            frame = next.checked_add(step);
        }
    }
    let mut seen = std::collections::HashSet::new();
    frames.retain(|frame| seen.insert(*frame));
    Ok(frames)
}

/// First, last, step.
fn parse_item(item: &str) -> Option<(i64, i64, i64)> {
    let (first, rest) = parse_number(item)?;
    if rest.is_empty() {
        return Some((first, first, 1));
    }
    let (last, rest) = parse_number(rest.strip_prefix("..").or_else(|| rest.strip_prefix('-'))?)?;
    if rest.is_empty() {
        return Some((first, last, 1));
    }
    let step: i64 = rest.strip_prefix(['x', ':'])?.parse().ok()?;
    (step > 0).then_some((first, last, step))
}

fn parse_number(text: &str) -> Option<(i64, &str)> {
    let digits = text.strip_prefix('-').unwrap_or(text);
    let length = digits.find(|c: char| !c.is_ascii_digit()).unwrap_or(digits.len()) + text.len() - digits.len();
    Some((text[..length].parse().ok()?, &text[length..]))
}

/// `I/N` of an option: the I-th of N parts, I from 1.
///
/// # Errors
/// `Usage`.
pub fn parse_part(option: &str, text: &str) -> Result<Part> {
    let parts = text.split_once('/').and_then(|(i, n)| Some((i.parse::<usize>().ok()?, n.parse::<usize>().ok()?)));
    match parts {
        Some((i, count)) if 1 <= i && i <= count => Ok(Part { index: i - 1, count }),
        _ => Err(Error::usage(format!("{option} {text} is not I/N"), format!("write {option} 1/4 to {option} 4/4"))),
    }
}

/// Of frames in parts of nearly equal length.
pub fn chunk(frames: &[i64], Part { index, count }: Part) -> Vec<i64> {
    let cut = |i: usize| (i as u128 * frames.len() as u128 / count as u128) as usize;
    frames[cut(index)..cut(index + 1)].to_vec()
}

/// `1-3,7,10-30:5` for 1, 2, 3, 7, 10, 15, 20, 25, 30.
pub fn format_frames(frames: &[i64]) -> String {
    let mut items = Vec::new();
    let mut rest = frames;
    while let [first, after @ ..] = rest {
        let step = after.first().and_then(|second| second.checked_sub(*first)).filter(|step| *step > 0).unwrap_or(1);
        let even = |pair: &&[i64]| pair[0].checked_add(step) == Some(pair[1]);
        let run = 1 + rest.windows(2).take_while(even).count();
        // Two frames that are no neighbours are no run: the second may begin one.
        let run = if step > 1 && run < 3 { 1 } else { run };
        let last = rest[run - 1];
        items.push(match (run, step) {
            (1, _) => first.to_string(),
            (_, 1) => format!("{first}-{last}"),
            _ => format!("{first}-{last}:{step}"),
        });
        rest = &rest[run..];
    }
    items.join(",")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_spellings() {
        for (text, frames) in [
            ("5", vec![5]),
            ("1-4", vec![1, 2, 3, 4]),
            ("1..4", vec![1, 2, 3, 4]),
            ("1-10x4", vec![1, 5, 9]),
            ("1-10:4", vec![1, 5, 9]),
            ("7,9, 8", vec![7, 9, 8]),
            ("-2", vec![-2]),
            ("-3--1", vec![-3, -2, -1]),
            ("-1..1", vec![-1, 0, 1]),
            ("-1-1", vec![-1, 0, 1]),
            ("1-3,2-4", vec![1, 2, 3, 4]),
            ("9223372036854775806-9223372036854775807", vec![i64::MAX - 1, i64::MAX]),
        ] {
            assert_eq!(parse_frames(text).unwrap(), frames, "{text}");
        }
    }

    #[test]
    fn what_is_no_list_is_refused() {
        for text in ["", "a", "1-", "-", "1,,2", "1-2x0", "1-2x-1", "1-2y3", "4-1", "1-99999999999", "1.5", "1...3"] {
            assert_eq!(parse_frames(text).unwrap_err().exit_code(), 2, "{text}");
        }
    }

    #[test]
    fn chunks_are_the_whole_in_order() {
        let frames: Vec<i64> = (0..10).collect();
        for n in 1..14 {
            let parts: Vec<i64> =
                (1..=n).flat_map(|i| chunk(&frames, parse_part("--chunk", &format!("{i}/{n}")).unwrap())).collect();
            assert_eq!(parts, frames);
        }
        for text in ["0/3", "4/3", "1", "a/b", "1/0"] {
            assert!(parse_part("--chunk", text).is_err(), "{text}");
        }
    }

    #[test]
    fn written_short() {
        for (text, frames) in [
            ("1-3,7,9-10", vec![1, 2, 3, 7, 9, 10]),
            ("1,3", vec![1, 3]),
            ("1-9:2", vec![1, 3, 5, 7, 9]),
            ("1,4-6,8", vec![1, 4, 5, 6, 8]),
            ("-7--1:3,4,2", vec![-7, -4, -1, 4, 2]),
            ("9223372036854775805,9223372036854775807", vec![i64::MAX - 2, i64::MAX]),
        ] {
            assert_eq!(format_frames(&frames), text);
            assert_eq!(parse_frames(text).unwrap(), frames);
        }
    }
}
