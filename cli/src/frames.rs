//! Which frames are rendered, and the files that each is written to.

use std::collections::HashMap;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use airlight_formats::image::check_ending;
use airlight_formats::sequence::numbered;

use crate::failure::Failure;

/// The most frames of one run. All of them are checked, and all names of files made, before the first is rendered.
const MOST: u32 = 100_000;

/// `A-B`, or a single frame.
pub(crate) fn parse(text: &str) -> Result<RangeInclusive<u32>, String> {
    let frame = |s: &str| s.parse::<u32>().map_err(|_| format!("\"{s}\" is no frame; frames are 0 to {}", u32::MAX));
    let (first, last) = text.split_once('-').unwrap_or((text, text));
    let (first, last) = (frame(first)?, frame(last)?);
    match last.checked_sub(first) {
        None => Err(format!("the last frame is before the first; {last}-{first} are frames in their order")),
        Some(more) if more >= MOST => Err(format!("these are more than {MOST} frames; render them in parts")),
        Some(_) => Ok(first..=last),
    }
}

/// Where each frame is written, checked before the work and not after it. `outputs` are as they were given; without any
/// it is the scene's name, `stem`. Of a sequence every output must have a place for the number.
pub(crate) fn outputs(
    outputs: &[PathBuf],
    stem: &Path,
    frames: RangeInclusive<u32>,
    sequence: bool,
) -> Result<Vec<Vec<PathBuf>>, Failure> {
    let endings: &[&str] = if sequence { &["####.exr", "####.png"] } else { &["exr", "png"] };
    let default: Vec<_> = endings.iter().map(|ending| stem.with_added_extension(ending)).collect();
    let patterns = if outputs.is_empty() { &default } else { outputs };
    for path in patterns {
        check_ending(path)?;
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        if !folder.is_dir() {
            let what = format!("{}: the folder {} does not exist", path.display(), folder.display());
            return Err(Failure::input(what));
        }
        if sequence && numbered(path, 0).is_none() {
            let what = "has no place for the number of the frame; write it as ####, as in out.####.exr";
            return Err(Failure::input(format!("{}: {what}", path.display())));
        }
    }
    // A # in the scene's own name is a letter like others.
    let literal = outputs.is_empty() && !sequence;
    let name = |path: &PathBuf, frame| if literal { None } else { numbered(path, frame) }.unwrap_or(path.clone());
    let names: Vec<Vec<_>> = frames.clone().map(|frame| patterns.iter().map(|p| name(p, frame)).collect()).collect();
    let mut taken = HashMap::new();
    for (frame, names) in frames.zip(&names) {
        for path in names {
            if path.is_dir() {
                return Err(Failure::input(format!("{}: is a folder; give the name of a file", path.display())));
            }
            if let Some(other) = taken.insert(path, frame).filter(|other| *other != frame) {
                let what = format!("would be written for frame {other} and for frame {frame}; give other names");
                return Err(Failure::input(format!("{}: {what}", path.display())));
            }
        }
    }
    Ok(names)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_one_or_from_to() {
        assert_eq!(parse("7"), Ok(7..=7));
        assert_eq!(parse("0-4294967295").unwrap_err(), "these are more than 100000 frames; render them in parts");
        assert_eq!(parse("4294967295"), Ok(u32::MAX..=u32::MAX));
        assert_eq!(parse("1-100000"), Ok(1..=100_000));
        assert!(parse("1-100001").is_err());
        assert_eq!(parse("5-3").unwrap_err(), "the last frame is before the first; 3-5 are frames in their order");
        for wrong in ["", "-", "1-", "-1", "1-2-3", "1.5", "a", "4294967296", "1..2"] {
            assert!(parse(wrong).unwrap_err().contains("is no frame"), "{wrong}");
        }
    }

    #[test]
    fn names_take_the_number_and_differ() {
        let of = |given: &[&str], frames, sequence| {
            let given: Vec<_> = given.iter().map(PathBuf::from).collect();
            let names = outputs(&given, Path::new("a#"), frames, sequence).map_err(|f| f.message)?;
            Ok::<_, String>(names.iter().flatten().map(|p| p.display().to_string()).collect::<Vec<_>>())
        };
        assert_eq!(of(&[], 3..=3, false).unwrap(), ["a#.exr", "a#.png"]);
        assert_eq!(of(&[], 3..=4, true).unwrap(), ["a#.0003.exr", "a#.0003.png", "a#.0004.exr", "a#.0004.png"]);
        assert_eq!(of(&["b.##.exr"], 3..=3, false).unwrap(), ["b.03.exr"]);
        assert_eq!(of(&["b.exr"], 3..=3, false).unwrap(), ["b.exr"]);
        let told = of(&["b.#.exr", "b.exr"], 3..=3, true).unwrap_err();
        assert!(told.starts_with("b.exr: has no place for the number"), "{told}");
        // What differs in its pattern may meet in a name.
        let told = of(&["b1#.exr", "b#.exr"], 1..=11, true).unwrap_err();
        assert!(told.starts_with("b11.exr: would be written for frame 1 and for frame 11"), "{told}");
    }
}
