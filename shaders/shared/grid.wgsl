// The linear number of a workgroup in a grid that is folded in two because one dimension holds at most 65,535 groups.
// The fold may overshoot: compare with the number of groups that there is work for.
fn group_index(group: vec3<u32>, groups: vec3<u32>) -> u32 {
    return group.y * groups.x + group.x;
}
