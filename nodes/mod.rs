//! The list of node types: one file and one entry each. Help, schema, README table and inspector come from it.

pub mod antialias;
pub mod blur_shadow;
pub mod camera;
pub mod caster_receiver;
pub mod compare;
pub mod cryptomatte;
pub mod directionality;
pub mod environment;
pub mod environment_image;
pub mod falloff;
pub mod final_gather;
pub mod grade;
pub mod illumination_brush;
pub mod indirect_shadow;
pub mod integrate;
pub mod keyframe_edits;
pub mod light;
pub mod localize_light;
pub mod material;
pub mod matte;
pub mod merge;
pub mod paint;
pub mod pick;
pub mod plate_samples;
pub mod ratio_blur;
pub mod ratio_grade;
pub mod ratio_image;
pub mod ratio_lattice;
pub mod ratio_pattern;
pub mod ratio_to_plate;
pub mod ratio_transform;
pub mod read_edits;
pub mod read_image;
pub mod relight;
pub mod remove_shadow;
pub mod rotate_shadow;
pub mod scale_offset;
pub mod scene;
pub mod select;
pub mod shadow_gradient;
pub mod source_brush;
pub mod synthesize_shadow;
pub mod texel_samples;
pub mod tint_shadow;
pub mod tone_map;
pub mod transfer;
pub mod translate_shadow;
pub mod transport;
pub mod view_samples;
pub mod view_texels;
pub mod visibility;
pub mod visibility_ratio;
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
    NodeType::of::<plate_samples::PlateSamples>(),
    NodeType::of::<texel_samples::TexelSamples>(),
    NodeType::of::<view_texels::ViewTexels>(),
    NodeType::of::<transfer::Transfer>(),
    NodeType::of::<pick::Pick>(),
    NodeType::of::<paint::Paint>(),
    NodeType::of::<matte::Matte>(),
    NodeType::of::<select::Select>(),
    NodeType::of::<caster_receiver::CasterReceiver>(),
    NodeType::of::<source_brush::SourceBrush>(),
    NodeType::of::<illumination_brush::IlluminationBrush>(),
    NodeType::of::<falloff::Falloff>(),
    NodeType::of::<indirect_shadow::IndirectShadow>(),
    NodeType::of::<keyframe_edits::KeyframeEdits>(),
    NodeType::of::<directionality::Directionality>(),
    NodeType::of::<read_edits::ReadEdits>(),
    NodeType::of::<write_edits::WriteEdits>(),
    NodeType::of::<scale_offset::ScaleOffset>(),
    NodeType::of::<relight::Relight>(),
    NodeType::of::<final_gather::FinalGather>(),
    NodeType::of::<visibility::Visibility>(),
    NodeType::of::<transport::Transport>(),
    NodeType::of::<localize_light::LocalizeLight>(),
    NodeType::of::<remove_shadow::RemoveShadow>(),
    NodeType::of::<shadow_gradient::ShadowGradient>(),
    NodeType::of::<translate_shadow::TranslateShadow>(),
    NodeType::of::<rotate_shadow::RotateShadow>(),
    NodeType::of::<blur_shadow::BlurShadow>(),
    NodeType::of::<tint_shadow::TintShadow>(),
    NodeType::of::<integrate::Integrate>(),
    NodeType::of::<visibility_ratio::VisibilityRatio>(),
    NodeType::of::<ratio_transform::RatioTransform>(),
    NodeType::of::<ratio_lattice::RatioLattice>(),
    NodeType::of::<ratio_blur::RatioBlur>(),
    NodeType::of::<ratio_grade::RatioGrade>(),
    NodeType::of::<ratio_pattern::RatioPattern>(),
    NodeType::of::<synthesize_shadow::SynthesizeShadow>(),
    NodeType::of::<ratio_image::RatioImage>(),
    NodeType::of::<ratio_to_plate::RatioToPlate>(),
    NodeType::of::<antialias::Antialias>(),
    NodeType::of::<read_image::ReadImage>(),
    NodeType::of::<cryptomatte::Cryptomatte>(),
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
