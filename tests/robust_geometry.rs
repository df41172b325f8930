//! The rows of hard geometry; all of the catalogue with `ETENDUE_FULL=1`.

mod robust_geometry {
    #[path = "mod.rs"]
    pub mod rows;
}

use robust_geometry::rows::ROWS;

#[test]
fn every_row_holds() {
    let full = std::env::var_os("ETENDUE_FULL").is_some();
    let mut failed = Vec::new();
    for (name, row) in ROWS {
        let clock = std::time::Instant::now();
        let cases = row(full);
        assert!(cases.len() > 1, "{name} has no cases");
        let (mut tried, mut wrong) = (0, 0);
        for (case, count, of) in cases {
            tried += of;
            assert!(of > 0, "{name}, {case}: nothing was tried");
            if count != 0.0 {
                wrong += 1;
                failed.push(format!("{name}, {case}: {count} of {of}"));
            }
        }
        println!("{name}: {tried} tried, {wrong} cases wrong, {:.1} s", clock.elapsed().as_secs_f64());
    }
    assert!(failed.is_empty(), "{} cases\n{}", failed.len(), failed.join("\n"));
}
