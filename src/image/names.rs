//! Names of layers and channels as renderers write them, and how a layer is found by name.

/// Why a layer was not found: what is wrong, and what to do about it.
#[derive(Clone, Debug, PartialEq)]
pub struct NotFound {
    pub message: String,
    pub help: String,
}

/// `ViewLayer.Diffuse Indirect.R` -> (`ViewLayer.Diffuse Indirect`, `R`): split at the last dot.
pub fn split(channel: &str) -> (&str, &str) {
    channel.rsplit_once('.').unwrap_or(("", channel))
}

/// `r`, `red`, `R` -> `R`, and so on for the channels with a fixed meaning; others stay as they are.
pub fn canonical(channel: &str) -> &str {
    match channel.to_ascii_lowercase().as_str() {
        "r" | "red" => "R",
        "g" | "green" => "G",
        "b" | "blue" => "B",
        "a" | "alpha" => "A",
        "x" => "X",
        "y" => "Y",
        "z" => "Z",
        _ => channel,
    }
}

/// Order of channels within a layer: R G B A, X Y Z, then the rest as in the file.
pub fn rank(channel: &str) -> usize {
    const ORDER: [&str; 7] = ["R", "G", "B", "A", "X", "Y", "Z"];
    ORDER.iter().position(|&known| known == channel).unwrap_or(ORDER.len())
}

/// Layers that hold positions, distances or identifiers even where their channels are called R, G and B.
pub fn is_data(layer: &str) -> bool {
    let own = bare(split(layer).1);
    let base = own.trim_end_matches(|c: char| c.is_ascii_digit());
    let data = ["z", "id", "uv", "st", "depth", "vector", "motionvector"];
    base.starts_with("crypto") || data.contains(&base) || POSITION.contains(&base) || NORMAL.contains(&base)
}

/// What renderers call world positions and world normals, as `bare` gives them.
pub const POSITION: [&str; 4] = ["p", "position", "worldposition", "pworld"];
pub const NORMAL: [&str; 4] = ["n", "normal", "worldnormal", "nworld"];

/// A name without case, blanks, underscores and the like.
pub fn bare(name: &str) -> String {
    name.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect()
}

/// How a layer is called in messages: the beauty has no name of its own.
pub fn title(layer: &str) -> &str {
    if layer.is_empty() { "beauty" } else { layer }
}

/// What the beauty is called where it has a name: by Blender, Arnold and Nuke, Karma, RenderMan.
/// As `bare` gives it; the first that is there counts.
const BEAUTY: [&str; 5] = ["combined", "rgba", "beauty", "c", "ci"];

/// Index of the layer called `wanted`. A name may leave leading parts out (`Diffuse Color` for
/// `ViewLayer.Diffuse Color`) where that is not ambiguous; the empty name and `beauty` are the beauty, whatever it
/// is called.
pub fn find(names: &[&str], wanted: &str) -> Result<usize, NotFound> {
    if let Some(exact) = names.iter().position(|&name| name == wanted) {
        return Ok(exact);
    }
    let beauty = matches!(wanted, "" | "beauty");
    if beauty && let Some(exact) = names.iter().position(|name| name.is_empty()) {
        return Ok(exact);
    }
    let indices = |matching: &dyn Fn(&str) -> bool| -> Vec<usize> {
        (0..names.len()).filter(|&index| matching(names[index])).collect()
    };
    let beauties = BEAUTY.iter().map(|known| indices(&|name| beauty && bare(split(name).1) == *known));
    let found = beauties.into_iter().find(|found| !found.is_empty()).unwrap_or_else(|| {
        indices(&|name| !wanted.is_empty() && name.strip_suffix(wanted).is_some_and(|rest| rest.ends_with('.')))
    });
    let list = |indices: &mut dyn Iterator<Item = usize>| {
        indices.map(|index| format!("\"{}\"", title(names[index]))).collect::<Vec<_>>().join(", ")
    };
    match found[..] {
        [only] => Ok(only),
        [] => {
            let nearest = names.iter().max_by(|a, b| likeness(a, wanted).total_cmp(&likeness(b, wanted)));
            Err(NotFound {
                message: format!("no layer \"{}\"; found {}", title(wanted), list(&mut (0..names.len()))),
                help: match nearest {
                    Some(name) if likeness(name, wanted) > 0.7 => format!("did you mean \"{}\"?", title(name)),
                    _ => "name one of the layers found".to_owned(),
                },
            })
        }
        _ => Err(NotFound {
            message: format!("layer \"{wanted}\" could be {}", list(&mut found.iter().copied())),
            help: "give the layer's full name".to_owned(),
        }),
    }
}

fn likeness(name: &str, wanted: &str) -> f64 {
    let (name, wanted) = (title(name).to_lowercase(), title(wanted).to_lowercase());
    strsim::jaro_winkler(&name, &wanted).max(strsim::jaro_winkler(split(&name).1, &wanted))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn splits_at_the_last_dot() {
        assert_eq!(split("ViewLayer.Diffuse Indirect.R"), ("ViewLayer.Diffuse Indirect", "R"));
        assert_eq!(split("RGBA_key.R"), ("RGBA_key", "R"));
        assert_eq!(split("R"), ("", "R"));
    }

    #[test]
    fn finds_layers() {
        let names = ["ViewLayer.Combined", "ViewLayer.Diffuse Color", "ViewLayer.Combined_key", "a.same", "b.same"];
        assert_eq!(find(&names, "Diffuse Color"), Ok(1));
        assert_eq!(find(&names, "ViewLayer.Diffuse Color"), Ok(1));
        assert_eq!(find(&names, ""), Ok(0));
        assert_eq!(find(&names, "beauty"), Ok(0));
        assert_eq!(find(&["", "beauty"], "beauty"), Ok(1));
        assert_eq!(find(&["C", "C_key"], "beauty"), Ok(0), "Karma's");
        assert_eq!(find(&["RGBA_key", "RGBA", "N"], ""), Ok(1), "Arnold's");
        assert!(find(&["Ci_key", "albedo"], "beauty").is_err());
        assert_eq!(find(&["Beauty", "C", "V.Combined"], ""), Ok(2), "several names: the first that is known");
        assert!(find(&["A.Combined", "B.Combined"], "").is_err(), "one name twice");
        let missing = find(&names, "Difuse Color").unwrap_err();
        assert!(missing.message.contains("\"ViewLayer.Combined_key\""), "{missing:?}");
        assert!(missing.help.contains("ViewLayer.Diffuse Color"), "{missing:?}");
        assert!(find(&names, "same").unwrap_err().message.contains("could be"));
        assert!(find(&[], "same").is_err());
    }

    #[test]
    fn knows_data() {
        assert!(is_data("P") && is_data("ViewLayer.CryptoObject00") && is_data("ViewLayer.Normal"));
        assert!(is_data("__Pworld") && is_data("World Position") && is_data("V.Depth"));
        assert!(!is_data("ViewLayer.Diffuse Color") && !is_data("") && !is_data("indirect"));
    }
}
