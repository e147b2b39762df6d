//! The nearest known name to one that is not known.

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
}
