//! Names that the user writes, against those that there are: the nearest one, and those that patterns choose.

use crate::{Error, Result};
use globset::Glob;

/// `did you mean "x"?`, or the list of what there is when nothing is near.
pub fn suggest<'a>(unknown: &str, known: impl IntoIterator<Item = &'a str>) -> String {
    let known: Vec<&str> = known.into_iter().collect();
    match nearest(unknown, &known) {
        Some(name) => format!("did you mean \"{name}\"?"),
        None if known.is_empty() => "there are none".to_owned(),
        None => format!("known: {}", known.join(", ")),
    }
}

/// The known name with the fewest typing errors between, if that is few enough to be a slip.
pub fn nearest<'a>(unknown: &str, known: &[&'a str]) -> Option<&'a str> {
    let lower = unknown.to_lowercase();
    let distance = |name: &str| strsim::damerau_levenshtein(&lower, &name.to_lowercase());
    let best = known.iter().copied().min_by_key(|name| distance(name))?;
    let allowed = (unknown.chars().count().max(best.chars().count()) / 3).max(1);
    (distance(best) <= allowed).then_some(best)
}

/// Which names match one of the patterns (`*`, `?`, `[..]`); all of them when there are no patterns.
///
/// # Errors
/// `Compute` for a pattern that is not well formed, or that matches nothing (the error says what there is). `what`: what
/// the names are names of.
pub fn chosen(what: &str, patterns: &[String], names: &[&str]) -> Result<Vec<bool>> {
    let mut chosen = vec![patterns.is_empty(); names.len()];
    for pattern in patterns {
        let glob = Glob::new(pattern).map_err(|error| {
            let message = format!("{what} pattern \"{pattern}\": {}", error.kind());
            Error::compute(message, "use * and ? as wildcards, [..] for sets")
        })?;
        let matcher = glob.compile_matcher();
        let mut found = false;
        for (chosen, name) in chosen.iter_mut().zip(names) {
            let matches = matcher.is_match(name);
            *chosen |= matches;
            found |= matches;
        }
        if !found {
            let help = suggest(pattern, names.iter().copied());
            return Err(Error::compute(format!("no {what} of the scene is called \"{pattern}\""), help));
        }
    }
    Ok(chosen)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_names_are_named_and_far_ones_listed() {
        assert_eq!(suggest("brigthness", ["brightness", "hue"]), "did you mean \"brightness\"?");
        assert_eq!(suggest("Scene", ["scene", "samples"]), "did you mean \"scene\"?");
        assert_eq!(suggest("wall", ["brightness", "hue"]), "known: brightness, hue");
        assert_eq!(suggest("x", []), "there are none");
    }

    #[test]
    fn patterns_choose_and_must_choose_something() {
        let names = ["red", "teal", "wood_1", "wood_2"];
        let find =
            |patterns: &[&str]| chosen("material", &patterns.iter().map(|p| p.to_string()).collect::<Vec<_>>(), &names);
        assert_eq!(find(&[]).unwrap(), [true; 4]);
        assert_eq!(find(&["wood_?", "red"]).unwrap(), [true, false, true, true]);
        let error = find(&["red", "glass"]).unwrap_err();
        assert!(error.to_string().contains("no material of the scene is called \"glass\""), "{error}");
        assert!(format!("{error:?}").contains("known: red, teal, wood_1, wood_2"), "{error:?}");
        assert!(find(&["[a"]).unwrap_err().to_string().contains("pattern"));
    }
}
