//! Results in files, and the report of them.

use std::fs;
use std::path::Path;

use airlight_conformance::{Case, Outcome, Sidecar, Subject, write_report};

/// A result with pictures of 3 × 2 pixels, which fails by its fifth value where `by` is not zero.
fn result(name: &str, by: f32) -> Sidecar {
    let case = Case::new(name, "A trial of <b>\"pictures\"</b> & scores.", move |_, record| {
        let mut found = [[0.5f32, 0.25, 0.125]; 6];
        found[1][1] += by;
        record.picture("radiance", [3, 2], found, [[0.5, 0.25, 0.125]; 6]);
        Ok(())
    });
    case.run(&Subject::of_choice("cpu"))
}

/// The same on a device of another name.
fn on(name: &str, result: Sidecar) -> Sidecar {
    let mut result = result;
    (result.device.id, result.device.name) = ("other:0".to_owned(), name.to_owned());
    result
}

fn report(folder: &Path, pictures: &[&str]) -> (String, Vec<String>) {
    let pictures: Vec<_> = pictures.iter().map(|&p| p.to_owned()).collect();
    let reported = write_report(folder, &pictures).unwrap();
    assert_eq!(reported.path, folder.join("index.html"));
    (fs::read_to_string(&reported.path).unwrap(), reported.damaged)
}

#[test]
fn a_result_is_the_same_when_it_is_read_again() {
    let folder = tempfile::tempdir().unwrap();
    let mut result = result("mine::case", 0.5);
    // Values that JSON has no numbers for.
    result.mismatches[0].values[0].found = f64::NEG_INFINITY;
    result.scores[0].value = f64::INFINITY;
    result.scores[1].threshold = 1.0 / 3.0;
    result.pictures[0].found[0] = [f32::INFINITY, -0.0, f32::MIN_POSITIVE];
    let path = result.write(folder.path()).unwrap();
    assert_eq!(path, result.path(folder.path()));
    assert!(path.ends_with("mine.case.json"), "{}", path.display());
    assert_eq!(Sidecar::read(&path).unwrap(), result);
    assert_eq!(fs::read_dir(path.parent().unwrap()).unwrap().count(), 1, "nothing else is left in the folder");

    result.outcome = Outcome::Skipped("it lacks a side".to_owned());
    result.mismatches[0].values[0].found = f64::NAN;
    assert_eq!(result.write(folder.path()).unwrap(), path, "a later result takes the earlier one's place");
    let again = Sidecar::read(&path).unwrap();
    assert_eq!(again.outcome, result.outcome);
    assert!(again.mismatches[0].values[0].found.is_nan());
}

#[test]
fn devices_that_differ_have_folders_of_their_own() {
    let plain = result("mine::case", 0.0).device;
    let mut other = plain.clone();
    other.features.push("a newer driver".to_owned());
    let mut hostile = plain.clone();
    hostile.name = "../../etc/ü\\:*?\"<>|\0 Device (R) ".repeat(9);
    let folders = [plain.folder(), other.folder(), hostile.folder()];
    assert!(folders[0] != folders[1] && folders[1] != folders[2]);
    for folder in folders {
        assert!(folder.len() < 80 && folder.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'-'), "{folder}");
    }
}

#[test]
fn a_failing_case_is_shown_with_its_pictures_and_numbers() {
    let folder = tempfile::tempdir().unwrap();
    result("mine::wrong", 0.5).write(folder.path()).unwrap();
    result("mine::right", 0.0).write(folder.path()).unwrap();
    on("Another", result("mine::right", 0.0)).write(folder.path()).unwrap();
    let (page, damaged) = report(folder.path(), &[]);
    assert!(damaged.is_empty());
    assert_eq!(page.matches("src=\"data:image/png;base64,").count(), 3, "found, expected and difference of one case");
    // 0.25 should be, 0.75 is, in the fifth value; that is the scale of the difference, as much as the largest value.
    for text in ["<td class=\"number\">4</td><td class=\"number\">0.75</td><td class=\"number\">0.25</td>", "5.000e-1"]
    {
        assert!(page.contains(text), "{text} is not in {page}");
    }
    assert!(page.contains("100.000 %") && page.contains("EXACT") && page.contains("sRGB"), "{page}");
    for count in ["2 passed", "1 failed", "on 2 devices"] {
        assert!(page.contains(count), "{count} is not in {page}");
    }
    for outside in ["http", "<script", "<link", "@import", "url("] {
        assert!(!page.contains(outside), "the page needs nothing but itself: {outside}");
    }

    let (page, _) = report(folder.path(), &["other:0::mine"]);
    assert_eq!(page.matches("src=\"data:image/png;base64,").count(), 6, "and those of one that was chosen");
    let (page, _) = report(folder.path(), &["mine"]);
    assert_eq!(page.matches("src=\"data:image/png;base64,").count(), 9);
}

#[test]
fn pictures_hold_the_pixels() {
    use base64::Engine;
    let folder = tempfile::tempdir().unwrap();
    let mut wrong = result("mine::wrong", 0.5);
    wrong.pictures[0].found[5] = [f32::NAN, 0.0, 0.0];
    wrong.write(folder.path()).unwrap();
    let (page, _) = report(folder.path(), &[]);
    let addresses = page.split("src=\"data:image/png;base64,").skip(1).map(|rest| rest.split('"').next().unwrap());
    let pictures: Vec<_> = addresses
        .map(|text| {
            let png = base64::engine::general_purpose::STANDARD.decode(text).unwrap();
            image::load_from_memory_with_format(&png, image::ImageFormat::Png).unwrap().to_rgb8()
        })
        .collect();
    let [found, expected, difference] = &pictures[..] else { panic!("{} pictures", pictures.len()) };
    assert!(pictures.iter().all(|p| p.dimensions() == (3, 2)));
    // The brightest expected value is white, half of it level 187.5 and a quarter of it level 136.96.
    assert_eq!(expected.get_pixel(1, 0).0, [255, 188, 137]);
    assert_eq!(found.get_pixel(1, 0).0, [255, 255, 137]);
    assert_eq!((found.get_pixel(0, 0), found.get_pixel(2, 1).0), (expected.get_pixel(0, 0), [255, 0, 255]));
    assert_eq!(difference.get_pixel(0, 0).0, [0, 0, 0]);
    assert_eq!(difference.get_pixel(1, 0).0, [255, 255, 255]);
    assert_eq!(difference.get_pixel(2, 1).0, [255, 0, 255]);
}

#[test]
fn text_is_escaped() {
    let folder = tempfile::tempdir().unwrap();
    let evil = "<script>alert(1)</script>\"' onload=x & <!--";
    let mut result = on(evil, result("mine::wrong", 0.5));
    result.outcome = Outcome::Failed(evil.to_owned());
    result.device.features = vec![evil.to_owned()];
    result.scores[0].name = evil.to_owned();
    result.scores[0].tolerance = Some(evil.to_owned());
    result.mismatches[0].name = evil.to_owned();
    result.pictures[0].name = evil.to_owned();
    result.parameters = vec![(evil.to_owned(), evil.to_owned())];
    result.tolerances[0].name = evil.to_owned();
    result.write(folder.path()).unwrap();
    fs::write(folder.path().join("<script>.json"), "{").unwrap();
    let (page, damaged) = report(folder.path(), &[]);
    assert_eq!(damaged.len(), 1);
    assert!(!page.contains("<script") && !page.contains("<!--") && !page.contains("\"' onload"), "{page}");
    assert!(page.contains("&lt;script&gt;") && page.contains("&lt;b&gt;&quot;pictures&quot;&lt;/b&gt; &amp; scores."));
}

#[test]
fn a_damaged_result_is_named_and_the_rest_is_reported() {
    let folder = tempfile::tempdir().unwrap();
    let good = result("mine::right", 0.0);
    let path = good.write(folder.path()).unwrap();
    let text = fs::read_to_string(&path).unwrap();
    let beside = |name: &str, text: &[u8]| fs::write(path.with_file_name(name), text).unwrap();
    beside("a-cut.json", &text.as_bytes()[..text.len() / 2]);
    beside("b-empty.json", b"");
    beside("c-newer.json", text.replace("\"format_version\": 1", "\"format_version\": 2").as_bytes());
    beside("d-size.json", text.replacen("3,\n        2\n", "3,\n        4000000000\n", 1).as_bytes());
    beside("e-bytes.json", &[0xff; 99]);
    beside("f-other.json", b"{\"name\": \"left-pad\"}");
    beside("g-base64.json", text.replacen("\"found\": \"", "\"found\": \"*", 1).as_bytes());
    beside("notes.txt", b"not looked at");
    fs::create_dir(path.with_file_name("h-folder.json")).unwrap();
    let (page, damaged) = report(folder.path(), &[]);
    assert_eq!(damaged.len(), 8, "{damaged:#?}");
    for (what, letter) in damaged.iter().zip('a'..) {
        assert!(what.contains(&format!("{letter}-")), "{letter}: {what}");
    }
    assert!(damaged[2].contains("airlight-conformance 2") && damaged[3].contains("4000000000"), "{damaged:#?}");
    assert!(page.contains("1 passed") && page.contains("c-newer.json") && page.contains("g-base64.json"));
}

#[test]
fn of_two_results_the_later_counts() {
    let folder = tempfile::tempdir().unwrap();
    let (mut old, mut new) = (result("mine::case", 0.5), result("mine::case", 0.0));
    (old.unix_time, new.unix_time) = (100, 200);
    // The same device's results, copied from another folder.
    for (name, result) in [("a", &new), ("b", &old)] {
        let path = result.write(&folder.path().join("tmp")).unwrap();
        fs::create_dir(folder.path().join(name)).unwrap();
        fs::rename(path, folder.path().join(name).join("mine.case.json")).unwrap();
    }
    let (page, _) = report(folder.path(), &[]);
    assert!(page.contains("1 passed") && !page.contains("failed</span>"), "{page}");
}
