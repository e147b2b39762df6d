//! What the headers of a file say beside its pixels.

use crate::image::ColourSpace;
use exr::meta::attribute::AttributeValue;
use exr::meta::header::Header;

/// Custom text attributes of all parts, by name; the first part that has a name decides.
pub(super) fn metadata(headers: &[Header]) -> Vec<(String, String)> {
    let mut found = std::collections::BTreeMap::new();
    for (name, value) in headers.iter().flat_map(texts) {
        found.entry(name).or_insert(value);
    }
    // These say how this file is built, not what it shows.
    found.remove("colorInteropID");
    found.remove("BlenderMultiChannel");
    found.into_iter().collect()
}

fn texts(header: &Header) -> impl Iterator<Item = (String, String)> {
    let own = &header.own_attributes;
    // The crate knows these by itself.
    let known = [
        ("owner", &own.owner),
        ("comments", &own.comments),
        ("capDate", &own.capture_date),
        ("software", &own.software_name),
    ];
    let known = known.into_iter().filter_map(|(name, value)| Some((name.to_owned(), text(value.as_ref()?.as_slice()))));
    let all = own.other.iter().chain(&header.shared_attributes.other);
    let others = all.filter_map(|(name, value)| match value {
        AttributeValue::Text(value) => Some((text(name.as_slice()), text(value.as_slice()))),
        _ => None,
    });
    known.chain(others)
}

/// The colour space that the first part with any says it is in, or what is not understood of that.
pub(super) fn colour_space(headers: &[Header]) -> Result<ColourSpace, String> {
    let says_nothing = ["data", "unknown", ""];
    let ids = headers.iter().flat_map(texts).filter(|(name, _)| name == "colorInteropID").map(|(_, id)| id);
    if let Some(id) = ids.into_iter().find(|id| !says_nothing.contains(&id.as_str())) {
        return ColourSpace::of_id(&id).ok_or(id);
    }
    let mut primaries = headers.iter().filter_map(|header| header.shared_attributes.chromaticities.as_ref());
    match primaries.next() {
        None => Ok(ColourSpace::default()),
        Some(found) => ColourSpace::of_chromaticities(found).ok_or_else(|| {
            let [red, green, blue, white] = [found.red, found.green, found.blue, found.white];
            format!("of primaries {red:?}, {green:?}, {blue:?}, white {white:?}")
        }),
    }
}

/// Text in headers is UTF-8 in most files, Latin-1 in old ones.
pub(super) fn text(bytes: &[u8]) -> String {
    match std::str::from_utf8(bytes) {
        Ok(text) => text.to_owned(),
        Err(_) => bytes.iter().map(|&byte| byte as char).collect(),
    }
}
