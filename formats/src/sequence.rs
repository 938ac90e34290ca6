//! Files of sequences: names with a place for the frame's number.

use std::path::{Path, PathBuf};

/// `path` with the number of a frame in place of the last run of `#` in its name, filled with zeros to the length of
/// the run; longer numbers take the room they need. Folders are left as they are. Where the name has no `#` there is
/// nothing to replace.
pub fn numbered(path: &Path, frame: u32) -> Option<PathBuf> {
    let name = path.file_name()?.to_str()?;
    let end = name.rfind('#')? + 1;
    let start = name[..end].trim_end_matches('#').len();
    let digits = end - start;
    Some(path.with_file_name(format!("{}{frame:0digits$}{}", &name[..start], &name[end..])))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_run_of_the_name_is_the_number() {
        let of = |path: &str, frame| numbered(Path::new(path), frame).map(|p| p.display().to_string());
        assert_eq!(of("cloud.####.vdb", 7).unwrap(), "cloud.0007.vdb");
        assert_eq!(of("cloud.####.vdb", 12345).unwrap(), "cloud.12345.vdb");
        assert_eq!(of("a/b#/c#1.##.exr", 3).unwrap(), "a/b#/c#1.03.exr");
        assert_eq!(of("#", u32::MAX).unwrap(), "4294967295");
        assert_eq!(of("wolke-ä-##é.exr", 5).unwrap(), "wolke-ä-05é.exr");
        assert_eq!(of("a#/cloud.vdb", 1), None);
        assert_eq!(of("", 1), None);
        assert_eq!(of("a/..", 1), None);
    }
}
