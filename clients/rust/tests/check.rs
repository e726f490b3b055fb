//! The doctor.

mod live;

use live::Spoilt;
use stellate::manifolds::Torus;
use stellate::proto::{CheckReport, Finding, Severity};
use stellate::{check, choose_epsilon, BoxError, Kind};

fn finding<'a>(report: &'a CheckReport, code: &str) -> &'a Finding {
    let found = report.findings.iter().find(|finding| finding.code == code);
    found.unwrap_or_else(|| panic!("no {code} in:\n{}", report.text))
}

#[test]
fn a_torus_and_its_epsilon() {
    let report = check(&Torus::default(), Some(0.3)).unwrap();
    assert!(report.ok && report.text.contains("keeps its contract"), "{}", report.text);
    assert!((report.reach() - 0.4).abs() < 0.01);
    assert_eq!(report.pieces(), 1);
    assert_eq!(finding(&report, "COARSE_EPSILON").severity(), Severity::Warning);
    let (epsilon, reason) = choose_epsilon(&Torus::default()).unwrap();
    assert_eq!(epsilon, 0.1);
    assert!(reason.starts_with("a quarter of the reach, about 0.4"), "{reason}");
}

#[test]
fn what_is_wrong() {
    let moving = || {
        Spoilt::new(|points: &mut [f64]| -> Result<(), BoxError> {
            points.iter_mut().for_each(|x| *x *= 1.01);
            Ok(())
        })
    };
    let report = check(&moving(), None).unwrap();
    let found = finding(&report, "NOT_IDEMPOTENT");
    assert!(!report.ok && found.severity() == Severity::Error);
    assert!(found.advice.contains("Answer with points of M"), "{}", found.advice);
    let error = choose_epsilon(&moving()).unwrap_err();
    assert_eq!((error.kind, &*error.reason), (Kind::Oracle, "ORACLE_BREAKS_CONTRACT"));
    let raises = Spoilt::new(|_: &mut [f64]| Err("no such surface".into()));
    let report = check(&raises, None).unwrap();
    assert!(finding(&report, "RAISED").message.contains("no such surface"));
}
