//! Writing a file so that it is either there in full or as it was before.

use crate::{Error, Result};
use std::io::Write;
use std::path::Path;

/// Writes to a temporary name in the same folder (made when missing), then renames.
pub fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    let failed = |error: std::io::Error| {
        Error::output(path, error.to_string(), "check that the folder exists and can be written, and its free space")
    };
    let name = path.file_name().ok_or_else(|| Error::output(path, "not the name of a file", "name a file"))?;
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    std::fs::create_dir_all(folder).map_err(failed)?;
    let mut builder = tempfile::Builder::new();
    let prefix = format!(".{}.", name.to_string_lossy());
    builder.prefix(&prefix).suffix(".tmp");
    #[cfg(unix)]
    {
        // As any program creates files: what the umask lets through, not only for the owner.
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    let mut file = builder.tempfile_in(folder).map_err(failed)?;
    file.write_all(bytes).map_err(failed)?;
    file.persist(path).map_err(|e| failed(e.error))?;
    Ok(())
}
