//! The program that measures figures.

use std::fs;
use std::process::Command;

/// Runs it and reads the page.
fn page(arguments: &[&str]) -> String {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("page.md");
    let images = folder.path().join("images");
    fs::create_dir(&images).unwrap();
    let run = Command::new(env!("CARGO_BIN_EXE_figures"))
        .args(arguments)
        .args([format!("--output={}", path.display()), format!("--images={}", images.display())])
        .output()
        .unwrap();
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    let page = fs::read_to_string(&path).unwrap();
    let mut linked = 0;
    for link in page.split("](images/").skip(1) {
        let name = link.split(')').next().unwrap();
        assert!(images.join(name).metadata().unwrap().len() > 100, "{name}");
        linked += 1;
    }
    assert_eq!(fs::read_dir(&images).unwrap().count(), linked, "pictures that the page does not show");
    page
}

#[test]
fn quick_figures_of_transfers_are_whole() {
    let page = page(&["--transfers", "--quick"]);
    let titles: Vec<&str> = page.lines().filter_map(|line| line.strip_prefix("## ")).collect();
    let expected = [
        "Against the reference pictures",
        "Compression by clusters",
        "The number of photons",
        "Times",
        "A new light",
        "Bases of the light",
        "Resolution",
        "Volume visualization",
    ];
    assert_eq!(titles, expected);
    // Every row of a table has its head's columns, and every number is one.
    let mut columns = 0;
    for line in page.lines() {
        let here = if line.starts_with('|') { line.matches('|').count() } else { 0 };
        assert!(columns == 0 || here == 0 || here == columns, "{line}");
        columns = here;
        assert!(!line.contains("NaN") && !line.contains("inf "), "{line}");
    }
}
