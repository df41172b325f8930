//! The catalogue of stiff and extreme cases, a test for every row: the table
//! that `etendue selftest` prints. Here its fast kind is run; the rest by
//! `etendue selftest --full`.
//!
//! Seeds are fixed. With others, all means of a run together raise a false alarm
//! with a probability of 1e-3 (`selftest::ALPHA`).

#![allow(clippy::print_stdout, reason = "the report of a test is what it prints")]

use etendue::accel::Accel;
use etendue::selftest::{ABSENT, Options, rows, run};

fn check(id: &str) {
    let accel = cfg!(feature = "embree").then(|| "embree".to_owned());
    let options = Options { only: vec![id.to_owned()], threads: 1, accel, ..Options::default() };
    let report = run(&options, &|_, _, _| ()).unwrap_or_else(|e| panic!("{e}"));
    println!("{report}");
    assert!(report.passed(), "\n{report}");
    let beaten = report.beaten("mitsuba");
    assert!(beaten.is_empty(), "closer to the truth in Mitsuba: {beaten:?}\n{report}");
}

/// A test of each row, and that there is one.
macro_rules! catalogue {
    ($($id:ident)*) => {
        $(#[test]
        fn $id() {
            check(stringify!($id));
        })*

        #[test]
        fn every_row_has_a_test() {
            let tested = [$(stringify!($id).to_uppercase()),*];
            let there: Vec<&str> = rows().iter().map(|row| row.id).collect();
            assert_eq!(there, tested);
            // The catalogue's own numbers, none twice and none forgotten.
            let mut all: Vec<&str> = there.into_iter().chain(ABSENT.iter().map(|(id, _)| *id)).collect();
            all.sort_by_key(|id| (id.as_bytes()[0], id[1..].parse::<u32>().unwrap_or(0)));
            let count = [('A', 25), ('B', 8), ('C', 9), ('D', 10), ('E', 8), ('F', 8)];
            let numbers = count.iter().flat_map(|(letter, n)| (1..=*n).map(move |i| format!("{letter}{i}")));
            assert_eq!(all, numbers.collect::<Vec<_>>());
        }
    };
}

catalogue! {
    a1 a2 a3 a4 a5 a6 a7 a8 a9 a10 a11 a12 a13 a14 a15 a16 a17 a18 a19 a20 a21 a22 a23 a24 a25
    b1 b2 b3 b5 b7 b8
    c1 c2 c3 c4 c5 c6 c7 c8 c9
    d1 d2 d3 d4 d5 d6 d7 d8 d9 d10
    e1 e2 e3 e4 e5 e6 e8
    f1 f2 f3 f4 f5 f6 f7 f8
}

#[test]
fn what_is_not_there_is_said() {
    let run = |id: &str, accel: Option<&str>| {
        let options =
            Options { only: vec![id.to_owned()], accel: accel.map(str::to_owned), ..Options::default() };
        run(&options, &|_, _, _| ()).err().map(|e| e.to_string()).unwrap_or_default()
    };
    assert!(run("Z9", None).contains("there is no row `Z9`"), "{}", run("Z9", None));
    assert!(run("b4", None).contains("media that scatter"), "{}", run("b4", None));
    assert!(run("A1", Some("octree")).contains("unknown accelerator `octree`"));
    assert!(Accel::NAMES.contains(&"bvh8"));
}
