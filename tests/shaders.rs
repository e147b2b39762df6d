//! Holds every shader against its declaration in Rust: it parses and validates, and its entry point, workgroup size,
//! bindings (names, order, access, element stride) and uniform struct (names, offsets, size) are what `Kernel` says.
//! Every file in shaders/ has a twin in src/kernels/ of the same stem, and the other way round.

use chiaro::device::{Access, Kernel};
use chiaro::kernels;
use naga::valid::{Capabilities, ValidationFlags, Validator};
use naga::{AddressSpace, Module, StorageAccess, TypeInner};
use std::collections::BTreeSet;
use std::path::Path;

fn stems(folder: &str, extension: &str) -> BTreeSet<String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join(folder);
    let files = std::fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path());
    files
        .filter(|file| file.extension().is_some_and(|e| e == extension))
        .map(|file| file.file_stem().unwrap().to_str().unwrap().to_owned())
        .collect()
}

#[test]
fn every_shader_has_a_twin_and_a_declaration() {
    let declared: Vec<_> = kernels::ALL.iter().map(|kernel| kernel.name.to_owned()).collect();
    assert!(declared.is_sorted(), "kernels::ALL is in the order of the alphabet");
    let declared = BTreeSet::from_iter(declared);
    assert_eq!(stems("shaders", "wgsl"), declared);
    let mut twins = stems("src/kernels", "rs");
    assert!(twins.remove("mod"));
    assert_eq!(twins, declared);
}

#[test]
fn shared_files_are_used_and_have_no_entry_point() {
    for stem in stems("shaders/shared", "wgsl") {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("shaders/shared/{stem}.wgsl"));
        let text = std::fs::read_to_string(path).unwrap();
        assert!(!text.contains("@compute"), "shaders/shared/{stem}.wgsl has an entry point");
        let used = kernels::ALL.iter().any(|kernel| kernel.shared.contains(&text.as_str()));
        assert!(used, "no kernel uses shaders/shared/{stem}.wgsl");
    }
}

#[test]
fn shaders_are_as_declared() {
    for kernel in kernels::ALL {
        check(kernel, &kernel.wgsl()).unwrap();
    }
}

/// The negative controls: each fault that the reflection is there to find.
#[test]
fn faults_are_found() {
    let kernel = &kernels::sparse_product::KERNEL;
    for (from, to, fault) in [
        ("first_entry", "first", "uniform"),
        ("pad1: u32,", "", "uniform"),
        ("var<storage, read_write> products", "var<storage, read> products", "validate"),
        ("var<storage, read> offsets", "var<storage, read_write> offsets", "offsets"),
        ("@binding(1)", "@binding(6)", "binding"),
        ("offsets", "starts", "offsets"),
        ("var<storage, read> scale: array<f32>", "var<storage, read> scale: array<vec2<f32>>", "validate"),
        ("@workgroup_size(64)", "@workgroup_size(32)", "workgroup"),
        ("fn sparse_product(", "fn other(", "entry"),
        ("let row =", "let row", "parse"),
    ] {
        let text = kernel.wgsl().replace(from, to);
        assert_ne!(text, kernel.wgsl(), "{from} is not in the shader");
        let found = check(kernel, &text).expect_err(&format!("{from} -> {to} was not noticed"));
        assert!(found.contains(fault), "{from} -> {to}: {found}");
    }
}

fn check(kernel: &Kernel, text: &str) -> Result<(), String> {
    let name = kernel.name;
    let module = naga::front::wgsl::parse_str(text)
        .map_err(|error| format!("{name} does not parse: {}", error.emit_to_string(text)))?;
    Validator::new(ValidationFlags::all(), Capabilities::empty())
        .validate(&module)
        .map_err(|error| format!("{name} does not validate: {}", error.emit_to_string(text)))?;
    equal(
        name,
        "entry points",
        &vec![name],
        &module.entry_points.iter().map(|entry| &*entry.name).collect::<Vec<_>>(),
    )?;
    equal(name, "workgroup size", &kernel.workgroup, &module.entry_points[0].workgroup_size)?;

    // (binding, name, access or none for the uniform, stride or size)
    let mut expected = vec![(0, "params".to_owned(), None, kernel.uniform.size)];
    for (i, binding) in kernel.bindings.iter().enumerate() {
        expected.push((i as u32 + 1, binding.name.to_owned(), Some(binding.access), binding.stride));
    }
    let mut found = Vec::new();
    for (_, variable) in module.global_variables.iter() {
        let Some(binding) = &variable.binding else { continue };
        equal(name, "binding group", &0, &binding.group)?;
        let (access, size) = match (variable.space, &module.types[variable.ty].inner) {
            (AddressSpace::Uniform, TypeInner::Struct { .. }) => {
                uniform(kernel, &module, variable.ty)?;
                (None, module.types[variable.ty].inner.size(module.to_ctx()) as usize)
            }
            (AddressSpace::Storage { access }, TypeInner::Array { stride, .. }) => {
                let writes = access.contains(StorageAccess::STORE);
                (Some(if writes { Access::ReadWrite } else { Access::Read }), *stride as usize)
            }
            (space, ty) => return Err(format!("{name}: binding {} is {space:?} {ty:?}", binding.binding)),
        };
        found.push((binding.binding, variable.name.clone().unwrap_or_default(), access, size));
    }
    found.sort_by_key(|binding| binding.0);
    equal(name, "bindings", &expected, &found)
}

fn uniform(kernel: &Kernel, module: &Module, ty: naga::Handle<naga::Type>) -> Result<(), String> {
    let TypeInner::Struct { members, span } = &module.types[ty].inner else { unreachable!("matched by the caller") };
    let found: Vec<_> = members.iter().map(|m| (m.name.as_deref().unwrap_or(""), m.offset as usize)).collect();
    equal(kernel.name, "uniform struct", &Some(kernel.uniform.name), &module.types[ty].name.as_deref())?;
    equal(kernel.name, "uniform fields", &kernel.uniform.fields.to_vec(), &found)?;
    equal(kernel.name, "uniform size", &kernel.uniform.size, &(*span as usize))
}

fn equal<T: PartialEq + std::fmt::Debug + ?Sized>(name: &str, what: &str, rust: &T, wgsl: &T) -> Result<(), String> {
    if rust == wgsl {
        return Ok(());
    }
    Err(format!("{name}: {what} differ\n  Rust {rust:?}\n  WGSL {wgsl:?}"))
}
