//! Files that appear whole or not at all.

use std::io::Write;
use std::path::Path;

use crate::error::FormatError;

/// Writes `bytes` to a file beside `path` and renames it to `path`; on an error nothing is left behind and what stood
/// at `path` stays.
pub(super) fn write(path: &Path, bytes: &[u8]) -> Result<(), FormatError> {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    builder.prefix(".airlight-");
    // Temporary files are private by default; this one is to get the permissions of any new file.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut file = builder.tempfile_in(folder).map_err(FormatError::io(path))?;
    file.write_all(bytes).and_then(|()| file.as_file().sync_all()).map_err(FormatError::io(path))?;
    file.persist(path).map_err(|e| FormatError::io(path)(e.error))?;
    Ok(())
}
