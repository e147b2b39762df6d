//! How the channels of a file make layers.

use super::header::text;
use crate::image::{Content, names};
use exr::meta::attribute::SampleType;
use exr::meta::header::Header;

/// One channel of a layer: where its samples lie in the blocks of a part.
pub(super) struct Slot {
    pub part: usize,
    /// Bytes before it in a pixel: rows hold all samples of the first channel, then all of the second, ...
    pub offset: usize,
    pub kind: SampleType,
    pub name: String,
}

pub(super) struct Plan {
    pub name: String,
    pub content: Content,
    pub slots: Vec<Slot>,
}

/// Groups the channels of all parts into layers, in the order of the file.
pub(super) fn plan_layers(headers: &[Header]) -> Vec<Plan> {
    let mut plans: Vec<Plan> = Vec::new();
    let name_of =
        |header: &Header| header.own_attributes.layer_name.as_ref().map_or(String::new(), |n| text(n.as_slice()));
    let is_beauty = |name: &str| names::find(&[name], "").is_ok();
    // One that is called otherwise is the beauty only where none is called so, and never data.
    let named_beauty = headers.iter().any(|header| is_beauty(&name_of(header)))
        || headers.first().is_some_and(|first| names::is_data(&name_of(first)));
    for (part, header) in headers.iter().enumerate() {
        let part_name = name_of(header);
        let plain: Vec<String> = header.channels.list.iter().map(|c| text(c.name.as_slice())).collect();
        let has_red = plain.iter().any(|name| names::canonical(name) == "R");
        let first_of_part = plans.len();
        let mut offset = 0;
        for (channel, full) in header.channels.list.iter().zip(&plain) {
            let (prefix, own) = names::split(full);
            let unnamed = part == 0 && has_red && (is_beauty(&part_name) || !named_beauty);
            let by_part = headers.len() > 1 && !part_name.is_empty() && !unnamed;
            let beauty = names::rank(names::canonical(own)) < 4 || (!has_red && names::canonical(own) == "Y");
            let layer = match prefix {
                "" if by_part => part_name.clone(),
                "" if beauty => String::new(),
                "" => own.to_owned(),
                prefix => prefix.to_owned(),
            };
            let slot = Slot { part, offset, kind: channel.sample_type, name: own.to_owned() };
            offset += channel.sample_type.bytes_per_sample();
            // A second part that repeats a layer (left and right eye) keeps it apart under the part's name.
            let layer = match plans[..first_of_part].iter().any(|plan| plan.name == layer) {
                true if layer.is_empty() => part_name.clone(),
                true => format!("{part_name}.{layer}"),
                false => layer,
            };
            match plans[first_of_part..].iter_mut().find(|plan| plan.name == layer) {
                Some(plan) => plan.slots.push(slot),
                None => plans.push(Plan { name: layer, content: Content::Data, slots: vec![slot] }),
            }
        }
        for plan in &mut plans[first_of_part..] {
            let known: Vec<&str> = plan.slots.iter().map(|slot| names::canonical(&slot.name)).collect();
            let distinct = (1..known.len()).all(|i| !known[..i].contains(&known[i]));
            if distinct {
                let known: Vec<String> = known.into_iter().map(str::to_owned).collect();
                plan.slots.iter_mut().zip(known).for_each(|(slot, name)| slot.name = name);
            }
            plan.slots.sort_by_key(|slot| names::rank(&slot.name));
            let coloured = plan.slots.iter().any(|slot| slot.name == "R") || plan.name.is_empty();
            let counted = plan.slots.iter().any(|slot| slot.kind == SampleType::U32);
            if coloured && !counted && !names::is_data(&plan.name) {
                plan.content = Content::Colour;
            }
        }
    }
    plans
}
