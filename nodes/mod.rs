//! The list of node types: one file and one entry each. Help, schema, README table and inspector come from it.

use crate::params::NodeType;

pub const ALL: &[NodeType] = &[];

/// The node type of that name.
pub fn find(name: &str) -> Option<&'static NodeType> {
    ALL.iter().find(|node| node.info.name == name)
}
