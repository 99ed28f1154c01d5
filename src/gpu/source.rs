//! The shaders' text: each is put together from an arithmetic, the pieces it names, and its constants.
//!
//! A shader says in a line `//! uses:` which files of `shaders/lib` it stands on, in order, and in a line
//! `//! constants:` what is fixed when it is compiled (a number of columns, a variant, the surface). Loops over such a number are
//! written out: what they index by then stays in registers, whatever the driver's compiler makes of loops. Of `if` and `else` over such a
//! variant one stays: compilers first put in what both call, which takes them most of their time. Nothing here needs a device.

/// Real numbers that a shader computes with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Arithmetic {
    /// f32.
    Single,
    /// f64, where the adapter has it.
    Double,
    /// Two f32, high and low: about 14 digits.
    TwoFloat,
}

impl Arithmetic {
    /// Name, for messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Single => "single",
            Self::Double => "double",
            Self::TwoFloat => "two-float",
        }
    }

    fn text(self) -> &'static str {
        match self {
            Self::Single => include_str!("../../shaders/lib/real_single.wgsl"),
            Self::Double => include_str!("../../shaders/lib/real_double.wgsl"),
            Self::TwoFloat => include_str!("../../shaders/lib/real_two.wgsl"),
        }
    }
}

/// One shader file.
#[derive(Clone, Copy, Debug)]
pub struct Shader {
    /// Stem of its file in `shaders/`.
    pub name: &'static str,
    /// Its text.
    pub text: &'static str,
    /// The function of the CPU that gives the same values, `path::name`.
    pub twin: &'static str,
}

macro_rules! shaders {
    ($($name:literal => $twin:literal,)*) => {
        /// Every shader, with its twin on the CPU.
        pub const SHADERS: &[Shader] = &[$(Shader {
            name: $name,
            text: include_str!(concat!("../../shaders/", $name, ".wgsl")),
            twin: $twin,
        },)*];
    };
}

shaders! {
    "apply" => "coupling/full/cpu/system.rs::apply",
    "apply_jvp" => "adjoint/src/kernel/flux/jvp.rs::flux_jvp",
    "apply_transpose" => "coupling/full/cpu/system.rs::apply_transpose",
    "apply_transpose_jvp" => "adjoint/src/kernel/flux/vjp.rs::flux_vjp",
    "batch_pull" => "coupling/reduced/many.rs::pull_back_pairs",
    "batch_solve" => "coupling/reduced/linearised.rs::new",
    "batch_tangent" => "coupling/reduced/second.rs::second",
    "blocks" => "coupling/reduced/linearised.rs::charges",
    "cgls" => "solver/cgls.rs::cgls",
    "combine" => "solver/columns.rs::combine",
    "conjugate" => "coupling/reduced/linearised.rs::respond",
    "coulomb" => "coupling/reduced/placed.rs::potentials",
    "coulomb_hvp" => "coupling/reduced/second.rs::link_tangent",
    "coulomb_jvp" => "coupling/reduced/second.rs::tangent_potentials",
    "coulomb_vjp" => "coupling/reduced/linearised.rs::pull_back",
    "diagonal" => "coupling/full/cpu/system.rs::new",
    "factor" => "boundary/mfs/mod.rs::solve_factor",
    "gmres" => "solver/gmres.rs::gmres",
    "impulse" => "coupling/full/cpu/placed.rs::impulse",
    "pair_hvp" => "coupling/full/cpu/second.rs::pair_tangent",
    "pair_vjp" => "coupling/full/cpu/first.rs::pair_tensor",
    "panel_hvp" => "coupling/panel/second.rs::pair_tangent",
    "panel_vjp" => "coupling/panel/first.rs::pair_tensor",
    "place" => "coupling/pair.rs::new",
    "products" => "solver/columns.rs::dots",
    "reduce" => "solver/columns.rs::add_scaled",
    "refine" => "solver/cgls.rs::cgls",
    "rows" => "boundary/mfs/assemble.rs::twist_rows",
    "sparse" => "solver/sparse_rows.rs::product",
    "sum" => "solver/columns.rs::add_scaled",
    "wrench" => "coupling/pair.rs::wrench",
}

macro_rules! pieces {
    ($($name:literal)*) => {
        /// The pieces that shaders stand on.
        const PIECES: &[(&str, &str)] = &[
            $(($name, include_str!(concat!("../../shaders/lib/", $name, ".wgsl"))),)*
        ];
    };
}

pieces! {
    "vector" "flux" "normal" "potential" "layers" "pairs" "faces" "panels" "tile" "faces_tile" "panels_tile" "motion"
    "gate" "gate_state" "points" "slopes" "displaced" "shifts" "total" "wrenches"
    "batch" "batch_rough" "batch_refine"
}

/// What is fixed when a shader is compiled.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Constant {
    /// A size.
    Number(u32),
    /// A variant.
    Flag(bool),
    /// What the faces are: the pieces named `surface` and `surface_tile`.
    Surface(Surface),
}

/// What the faces of a coupled system are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Surface {
    /// Rows of sources inside the bodies.
    Faces,
    /// Panels with single and double layers.
    Panels,
}

impl Surface {
    /// The pieces that stand for one of these names.
    fn pieces(self, name: &str) -> Option<&'static [&'static str]> {
        match (self, name) {
            (Self::Faces, "surface") => Some(&["flux", "normal", "potential", "pairs", "faces"]),
            (Self::Faces, "surface_tile") => Some(&["faces_tile"]),
            (Self::Panels, "surface") => Some(&["flux", "layers", "pairs", "panels"]),
            (Self::Panels, "surface_tile") => Some(&["panels_tile"]),
            _ => None,
        }
    }

    /// Points, vectors and other numbers of a face.
    pub fn layout(self) -> [usize; 3] {
        match self {
            // Corners; m; weight.
            Self::Faces => [3, 1, 1],
            // Corners and centroid; m, p, q; charge, 1/|m|, trace, ρ².
            Self::Panels => [4, 3, 4],
        }
    }

    /// The same as the constants of a shader that places faces.
    pub fn constants(self) -> [(&'static str, Constant); 3] {
        let names = ["MOVED", "ROTATED", "SCALARS"];
        std::array::from_fn(|k| (names[k], Constant::Number(self.layout()[k] as u32)))
    }
}

/// The words after `//! key:`.
fn directive<'a>(text: &'a str, key: &str) -> Vec<&'a str> {
    text.lines()
        .filter_map(|l| l.strip_prefix("//! ")?.strip_prefix(key)?.strip_prefix(':'))
        .flat_map(str::split_whitespace)
        .collect()
}

impl Shader {
    /// The shader of this name.
    pub fn named(name: &str) -> Option<&'static Self> {
        SHADERS.iter().find(|s| s.name == name)
    }

    /// Names of its constants.
    pub fn constants(&self) -> Vec<&'static str> {
        directive(self.text, "constants")
    }

    /// Its text in an arithmetic; `None` if a piece or a constant is missing.
    pub fn assemble(
        &self,
        arithmetic: Arithmetic,
        constants: &[(&str, Constant)],
    ) -> Option<String> {
        let mut out = arithmetic.text().to_string();
        let mut surface = None;
        for name in self.constants() {
            let (_, value) = constants.iter().find(|(n, _)| *n == name)?;
            match value {
                Constant::Number(n) => out.push_str(&format!("\nconst {name}: u32 = {n}u;")),
                Constant::Flag(f) => out.push_str(&format!("\nconst {name}: bool = {f};")),
                Constant::Surface(s) => surface = Some(*s),
            }
        }
        for name in directive(self.text, "uses") {
            let one = [name];
            let names = surface.and_then(|s| s.pieces(name)).unwrap_or(&one);
            for name in names {
                out.push('\n');
                let piece = PIECES.iter().find(|(n, _)| n == name)?.1;
                write_out(&piece.lines().collect::<Vec<_>>(), constants, &mut out);
            }
        }
        // Inner doc lines are read above; they are no comments that the language knows.
        let lines: Vec<&str> = (self.text.lines())
            .filter(|l| !l.starts_with("//! "))
            .collect();
        out.push('\n');
        write_out(&lines, constants, &mut out);
        Some(out)
    }
}

/// Counter and end of a loop over one of the constants.
fn counted<'a>(line: &'a str, constants: &[(&str, Constant)]) -> Option<(&'a str, u32)> {
    let (counter, rest) = line
        .trim_start()
        .strip_prefix("for (var ")?
        .split_once(" = 0u; ")?;
    let end = rest.strip_prefix(counter)?.strip_prefix(" < ")?;
    let (name, step) = end.split_once("; ")?;
    let known = constants.iter().find(|(n, _)| *n == name);
    match known {
        Some((_, Constant::Number(n))) if step == format!("{counter}++) {{") => Some((counter, *n)),
        _ => None,
    }
}

/// What of an `if` over one of the constants is kept, from the lines behind it: their range, and where the text goes on.
fn chosen(
    lines: &[&str],
    at: usize,
    constants: &[(&str, Constant)],
) -> Option<(std::ops::Range<usize>, usize)> {
    let line = lines[at].trim_start();
    let indent = &lines[at][..lines[at].len() - line.len()];
    let asked = line.strip_prefix("if ")?.strip_suffix(" {")?;
    let (name, wanted) = match asked.strip_prefix('!') {
        Some(name) => (name, false),
        None => (asked, true),
    };
    let known = constants.iter().find(|(n, _)| *n == name);
    let Some((_, Constant::Flag(flag))) = known else {
        return None;
    };
    let closing = |from: usize| {
        let closes =
            |i: &usize| (lines[*i].strip_prefix(indent)).is_some_and(|l| l.starts_with('}'));
        let i = (from..lines.len()).find(closes)?;
        Some((i, lines[i].trim_start()))
    };
    let (yes, no, end) = match closing(at + 1)? {
        (end, "}") => (at + 1..end, end..end, end),
        (other, "} else {") => match closing(other + 1)? {
            (end, "}") => (at + 1..other, other + 1..end, end),
            _ => return None,
        },
        _ => return None,
    };
    Some((if *flag == wanted { yes } else { no }, end + 1))
}

/// Lines with their loops over constants written out, and what constants choose.
fn write_out(lines: &[&str], constants: &[(&str, Constant)], out: &mut String) {
    let mut at = 0;
    while at < lines.len() {
        let line = lines[at];
        let indent = &line[..line.len() - line.trim_start().len()];
        let closing = || (at + 1..lines.len()).find(|i| lines[*i] == format!("{indent}}}"));
        if let (Some((counter, count)), Some(end)) = (counted(line, constants), closing()) {
            for k in 0..count {
                out.push_str(&format!(
                    "{indent}{{\n{indent}    const {counter}: u32 = {k}u;\n"
                ));
                write_out(&lines[at + 1..end], constants, out);
                out.push_str(&format!("{indent}}}\n"));
            }
            at = end + 1;
            continue;
        }
        if let Some((kept, next)) = chosen(lines, at, constants) {
            if !kept.is_empty() {
                out.push_str(&format!("{indent}{{\n"));
                write_out(&lines[kept], constants, out);
                out.push_str(&format!("{indent}}}\n"));
            }
            at = next;
            continue;
        }
        out.push_str(line);
        out.push('\n');
        at += 1;
    }
}
