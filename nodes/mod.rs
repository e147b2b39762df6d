//! The list of node types: one file and one entry each. Help, schema, README table and inspector come from it.

pub mod compare;
pub mod grade;
pub mod merge;
pub mod read_image;
pub mod write_image;

use crate::params::NodeType;

pub const ALL: &[NodeType] = &[
    NodeType::of::<read_image::ReadImage>(),
    NodeType::of::<write_image::WriteImage>(),
    NodeType::of::<merge::Merge>(),
    NodeType::of::<grade::Grade>(),
    NodeType::of::<compare::Compare>(),
];

/// The node type of that name.
pub fn find(name: &str) -> Option<&'static NodeType> {
    ALL.iter().find(|node| node.info.name == name)
}
