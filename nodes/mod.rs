//! The list of node types: one file and one entry each. Help, schema, README table and inspector come from it.

pub mod camera;
pub mod caster_receiver;
pub mod compare;
pub mod directionality;
pub mod environment;
pub mod environment_image;
pub mod falloff;
pub mod grade;
pub mod illumination_brush;
pub mod indirect_shadow;
pub mod integrate;
pub mod light;
pub mod localize_light;
pub mod material;
pub mod merge;
pub mod paint;
pub mod pick;
pub mod read_edits;
pub mod read_image;
pub mod relight;
pub mod scale_offset;
pub mod scene;
pub mod select;
pub mod source_brush;
pub mod tone_map;
pub mod transfer;
pub mod transport;
pub mod view_samples;
pub mod visibility;
pub mod write_edits;
pub mod write_image;

use crate::params::NodeType;

pub const ALL: &[NodeType] = &[
    NodeType::of::<scene::Scene>(),
    NodeType::of::<light::Light>(),
    NodeType::of::<material::Material>(),
    NodeType::of::<camera::Camera>(),
    NodeType::of::<environment::Environment>(),
    NodeType::of::<environment_image::EnvironmentImage>(),
    NodeType::of::<view_samples::ViewSamples>(),
    NodeType::of::<transfer::Transfer>(),
    NodeType::of::<pick::Pick>(),
    NodeType::of::<paint::Paint>(),
    NodeType::of::<select::Select>(),
    NodeType::of::<caster_receiver::CasterReceiver>(),
    NodeType::of::<source_brush::SourceBrush>(),
    NodeType::of::<illumination_brush::IlluminationBrush>(),
    NodeType::of::<falloff::Falloff>(),
    NodeType::of::<indirect_shadow::IndirectShadow>(),
    NodeType::of::<directionality::Directionality>(),
    NodeType::of::<read_edits::ReadEdits>(),
    NodeType::of::<write_edits::WriteEdits>(),
    NodeType::of::<scale_offset::ScaleOffset>(),
    NodeType::of::<relight::Relight>(),
    NodeType::of::<visibility::Visibility>(),
    NodeType::of::<transport::Transport>(),
    NodeType::of::<integrate::Integrate>(),
    NodeType::of::<localize_light::LocalizeLight>(),
    NodeType::of::<read_image::ReadImage>(),
    NodeType::of::<write_image::WriteImage>(),
    NodeType::of::<merge::Merge>(),
    NodeType::of::<grade::Grade>(),
    NodeType::of::<tone_map::ToneMap>(),
    NodeType::of::<compare::Compare>(),
];

/// The node type of that name.
pub fn find(name: &str) -> Option<&'static NodeType> {
    ALL.iter().find(|node| node.info.name == name)
}
