//! Files that appear whole or not at all.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use crate::FormatError;

/// Writes a file: `write` fills a temporary file beside `path`, which then takes its place. When anything fails, the
/// temporary file is removed and what stood at `path` stays. A symbolic link is followed. The file gets the
/// permissions of any newly created one.
///
/// # Errors
/// Those of `write`; a folder that is missing; something at `path` that is not a regular file; a full disk.
pub fn write_atomically(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<&File>) -> Result<(), FormatError>,
) -> Result<(), FormatError> {
    let target = resolve(path)?;
    let folder = match target.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    if !folder.is_dir() {
        let what = format!("the folder {} does not exist", folder.display());
        return Err(FormatError::io(path)(io::Error::new(io::ErrorKind::NotFound, what)));
    }
    let mut builder = tempfile::Builder::new();
    builder.prefix(".airlight-").suffix(".tmp");
    // Temporary files are private by default; the finished one is as public as the user's mask lets it be.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let temporary = builder.tempfile_in(folder).map_err(FormatError::io(path))?;
    let mut buffer = BufWriter::with_capacity(1 << 16, temporary.as_file());
    write(&mut buffer)?;
    buffer.flush().map_err(FormatError::io(path))?;
    drop(buffer);
    // Some file systems report a lack of space only here.
    temporary.as_file().sync_all().map_err(FormatError::io(path))?;
    temporary.persist(&target).map_err(|e| FormatError::io(path)(e.error))?;
    Ok(())
}

/// The file that `path` stands for, once it is clear that a regular file may stand there.
fn resolve(path: &Path) -> Result<PathBuf, FormatError> {
    let refuse = |what: &str| Err(FormatError::io(path)(io::Error::new(io::ErrorKind::InvalidInput, what)));
    if path.file_name().is_none() {
        return refuse("names no file");
    }
    match fs::metadata(path) {
        Ok(found) if found.is_dir() => refuse("is a folder; give the name of a file"),
        Ok(found) if !found.is_file() => refuse("is not a regular file"),
        Ok(_) => fs::canonicalize(path).map_err(FormatError::io(path)),
        Err(_) => Ok(path.to_path_buf()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<_> =
            fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn a_failure_leaves_the_old_file_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out.bin");
        write_atomically(&path, |w| w.write_all(b"old").map_err(FormatError::io(&path))).unwrap();
        let error = write_atomically(&path, |w| {
            w.write_all(&[7; 1 << 20]).map_err(FormatError::io(&path))?;
            Err(FormatError::io(&path)(io::Error::from(io::ErrorKind::StorageFull)))
        });
        assert!(error.unwrap_err().to_string().contains("out.bin: "));
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(names(folder.path()), ["out.bin"]);
    }

    #[test]
    fn folders_devices_and_missing_folders_are_refused_with_words() {
        let folder = tempfile::tempdir().unwrap();
        let fails = |path: &Path| write_atomically(path, |_| Ok(())).unwrap_err().to_string();
        assert!(fails(folder.path()).ends_with("is a folder; give the name of a file"));
        let missing = fails(&folder.path().join("no/such/out.exr"));
        assert!(missing.contains("no/such/out.exr: the folder") && missing.ends_with("does not exist"), "{missing}");
        #[cfg(unix)]
        assert!(fails(Path::new("/dev/null")).ends_with("is not a regular file"));
        assert!(names(folder.path()).is_empty());
    }

    #[cfg(unix)]
    #[test]
    fn permissions_are_those_of_a_created_file_and_links_are_followed() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let (path, link, plain) =
            (folder.path().join("out.bin"), folder.path().join("link"), folder.path().join("plain"));
        write_atomically(&path, |_| Ok(())).unwrap();
        File::create(&plain).unwrap();
        let mode = |p: &Path| fs::metadata(p).unwrap().permissions().mode();
        assert_eq!(mode(&path), mode(&plain));
        std::os::unix::fs::symlink("out.bin", &link).unwrap();
        write_atomically(&link, |w| w.write_all(b"new").map_err(FormatError::io(&link))).unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::read(&path).unwrap(), b"new");
    }
}
