//! The exact table of two equal spheres.

use serde_json::Value;
use std::path::Path;

/// Spheres of radius 1 at unit density, centres d apart: along the line of centres M11 and M12, across it M11
/// and M12 (multipoles against images, agreeing to 1e-16); by growing d.
pub fn table() -> Vec<(f64, [f64; 4])> {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/two_spheres.json");
    let text = std::fs::read_to_string(file).expect("the table is in the repository");
    let data: Value = serde_json::from_str(&text).expect("the table is JSON");
    let number = |value: &Value| value.as_f64().expect("a number");
    let row = |row: &Value| {
        let of = |line: &str, name: &str| number(&row[line][name]);
        let values = [
            of("longitudinal", "M11"),
            of("longitudinal", "M12"),
            of("transverse", "M11"),
            of("transverse", "M12"),
        ];
        (number(&row["d"]), values)
    };
    let rows = data["equal"].as_array().expect("rows");
    rows.iter().map(row).collect()
}
