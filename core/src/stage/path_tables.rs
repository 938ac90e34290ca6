//! Tables of the stage [`Path`]: what its paths choose from, and by which chances.

use std::f64::consts::PI;

use glam::DVec3;

use crate::light::Environment;
use crate::media::Phase;
use crate::stage::{MaterialRecord, Path, PathParams, PhaseParams};

/// What [`Path::tables`] hold.
#[derive(Clone, Debug)]
pub struct PathTables<'a> {
    /// The medium's phase function.
    pub phase: &'a Phase,
    /// Probabilities with which the lights, and behind them the environment where there is one, are chosen. They sum to 1.
    pub chances: Vec<f64>,
    /// Materials of the mesh.
    pub materials: Vec<MaterialRecord>,
    /// The environment.
    pub environment: Option<&'a Environment>,
}

impl PathTables<'_> {
    /// Cells of the environment along u and v.
    fn cells(&self) -> [u32; 2] {
        self.environment.map_or([0, 0], |e| [e.image().width, e.image().height].map(sky_side))
    }

    /// Says in the parameters where each table begins. Their length in values, at least one.
    pub fn place(&self, params: &mut PathParams) -> u32 {
        let phase = PhaseParams::new(self.phase);
        (params.phase_kind, params.phase, params.phase_size) = (phase.kind, phase.lobes, phase.table.len() as u32);
        params.choices = self.chances.len() as u32;
        let cells = self.cells();
        [params.sky_columns, params.sky_rows] = cells;
        let choice = |items: u32| Path::CHOICE * items;
        params.phase_at = 0;
        params.bends_at = params.phase_size;
        params.choices_at = params.bends_at + choice(params.phase_size.saturating_sub(1));
        params.materials_at = params.choices_at + choice(params.choices);
        params.edges_at = params.materials_at + 8 * self.materials.len() as u32;
        params.sky_at = params.edges_at + cells[1] + 1;
        params.sky_at + choice(cells[0] * cells[1])
    }

    /// The values.
    pub fn values(&self) -> Vec<f32> {
        let mut values = PhaseParams::new(self.phase).table;
        if let Phase::Table(table) = self.phase {
            values.extend(bends(table.values()));
        }
        values.extend(choose(&self.chances, |_, chance| chance));
        values.extend(bytemuck::cast_slice::<_, f32>(&self.materials));
        let [columns, rows] = self.cells();
        values.extend((0..=rows).map(|row| (PI * f64::from(row) / f64::from(rows.max(1))).cos() as f32));
        if let Some(environment) = self.environment {
            values.extend(sky_choice(environment, [columns, rows]));
        }
        values
    }
}

/// Items to be chosen with these weights, and for each what its choice goes by, from its number and probability: the alias
/// method, as [`Path::tables`] says it.
fn choose(weights: &[f64], by: impl Fn(usize, f64) -> f64) -> Vec<f32> {
    let sum: f64 = weights.iter().sum();
    let n = weights.len();
    let mut items: Vec<[f64; 3]> = (0..n).map(|i| [1.0, i as f64, by(i, weights[i] / sum)]).collect();
    // What each place holds of its own item, in parts of a place; those above one give to those below.
    let mut parts: Vec<f64> = weights.iter().map(|w| w / sum * n as f64).collect();
    let (mut small, mut large): (Vec<_>, Vec<_>) = (0..n).partition(|&i| parts[i] < 1.0);
    while let (Some(&giver), Some(taker)) = (large.last(), small.pop()) {
        (items[taker][0], items[taker][1]) = (parts[taker], giver as f64);
        parts[giver] -= 1.0 - parts[taker];
        if parts[giver] < 1.0 {
            large.pop();
            small.push(giver);
        }
    }
    items.into_iter().flatten().map(|v| v as f32).collect()
}

/// The choice among the pieces of a phase function's table, by 1/sr: each piece is drawn evenly in solid angle.
pub(super) fn bends(values: &[f64]) -> Vec<f32> {
    let last = (values.len() - 1) as f64;
    let angle = |i: f64| PI * i / last;
    let band = |i: usize| 2.0 * PI * (angle(i as f64).cos() - angle(i as f64 + 1.0).cos());
    // Simpson's rule over the piece, whose value is linear in the angle.
    let piece = |i: usize| {
        let at = |t: f64| (values[i] + t * (values[i + 1] - values[i])) * angle(i as f64 + t).sin();
        2.0 * PI * angle(1.0) * (at(0.0) + 4.0 * at(0.5) + at(1.0)) / 6.0
    };
    let weights: Vec<f64> = (0..values.len() - 1).map(piece).collect();
    choose(&weights, |i, chance| chance / band(i))
}

/// Cells along a side of an environment of so many texels: a power of two, so that every cell is drawn by as many numbers.
fn sky_side(texels: u32) -> u32 {
    /// Cells along the longer side at the most.
    const MOST: u32 = 1024;
    1 << texels.clamp(1, MOST).ilog2()
}

/// The choice among the cells of an environment, by 1/sr, in proportion to their light (mean of the channels).
fn sky_choice(environment: &Environment, [columns, rows]: [u32; 2]) -> Vec<f32> {
    let image = environment.image();
    let (width, height) = (i64::from(image.width), i64::from(image.height));
    let scale = environment.scale.as_dvec3();
    let grey = |i: i64, j: i64| {
        let [r, g, b] = image.texels[(j.clamp(0, height - 1) * width + i.rem_euclid(width)) as usize];
        (DVec3::new(r.into(), g.into(), b.into()) * scale).element_sum() / 3.0
    };
    let count = (columns * rows) as usize;
    let (mut sums, mut points) = (vec![0.0; count], vec![0u32; count]);
    // The bilinear function at four points of each texel: whatever shines in a cell, some of them see.
    for (y, x) in (0..2 * height).flat_map(|y| (0..2 * width).map(move |x| (y, x))) {
        let (i, j) = (x / 2, y / 2);
        let (across, down) = (i + 2 * (x % 2) - 1, j + 2 * (y % 2) - 1);
        let value = (9.0 * grey(i, j) + 3.0 * (grey(across, j) + grey(i, down)) + grey(across, down)) / 16.0;
        let cell = |at: i64, of: i64, cells: u32| (2 * at + 1) * i64::from(cells) / (4 * of);
        let place = (cell(y, height, rows) * i64::from(columns) + cell(x, width, columns)) as usize;
        sums[place] += value;
        points[place] += 1;
    }
    let edge = |row: u32| (PI * f64::from(row) / f64::from(rows)).cos();
    let angle = |cell: usize| {
        let row = cell as u32 / columns;
        2.0 * PI / f64::from(columns) * (edge(row) - edge(row + 1))
    };
    let mut weights: Vec<f64> =
        (0..count).map(|cell| sums[cell] / f64::from(points[cell].max(1)) * angle(cell)).collect();
    if weights.iter().sum::<f64>() == 0.0 {
        weights = (0..count).map(angle).collect();
    }
    choose(&weights, |cell, chance| chance / angle(cell))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::Image;
    use crate::media::PhaseTable;

    /// How often each item is chosen, over all places and the whole of the second number.
    fn frequencies(choice: &[f32]) -> Vec<f64> {
        let n = choice.len() / 3;
        let mut found = vec![0.0; n];
        for (place, item) in choice.chunks_exact(3).enumerate() {
            found[place] += f64::from(item[0]) / n as f64;
            found[item[1] as usize] += (1.0 - f64::from(item[0])) / n as f64;
        }
        found
    }

    #[test]
    fn items_are_chosen_by_their_weights() {
        for weights in [vec![1.0], vec![3.0, 0.0, 1.0, 0.5, 7.0], vec![1.0; 6], vec![1e-9, 1.0, 1e-3]] {
            let sum: f64 = weights.iter().sum();
            let choice = choose(&weights, |_, chance| chance);
            for (i, frequency) in frequencies(&choice).into_iter().enumerate() {
                // Parts of places are rounded to f32.
                assert!((frequency - weights[i] / sum).abs() < 1e-7, "{weights:?} {i}: {frequency}");
                assert!((f64::from(choice[3 * i + 2]) - weights[i] / sum).abs() < 1e-7);
            }
        }
    }

    #[test]
    fn densities_of_cells_and_pieces_are_those_of_the_choice() {
        let texels =
            (0..40u8).map(|i| [f32::from(i % 7), f32::from(i % 3), if i == 29 { 90.0 } else { 0.0 }]).collect();
        let sky = Environment::new(Image { width: 8, height: 5, texels }).unwrap();
        let cells = [sky_side(8), sky_side(5)];
        assert_eq!(cells, [8, 4]);
        let choice = sky_choice(&sky, cells);
        let band = |row: u32| (PI * f64::from(row) / 4.0).cos() - (PI * f64::from(row + 1) / 4.0).cos();
        for (cell, chance) in frequencies(&choice).into_iter().enumerate() {
            let angle = 2.0 * PI / 8.0 * band(cell as u32 / 8);
            assert!((f64::from(choice[3 * cell + 2]) * angle - chance).abs() < 1e-6, "{cell}");
        }
        let degrees: Vec<f64> = (0..=180).map(f64::from).collect();
        let values: Vec<f64> = degrees.iter().map(|d| 1.0 + (d / 20.0).cos()).collect();
        let table = PhaseTable::new(&degrees, &values).unwrap();
        let found = bends(table.values());
        let last = table.values().len() - 1;
        for (i, chance) in frequencies(&found).into_iter().enumerate() {
            let at = |i: usize| PI * i as f64 / last as f64;
            let band = 2.0 * PI * (at(i).cos() - at(i + 1).cos());
            let (stated, mean) = (f64::from(found[3 * i + 2]), 0.5 * (table.values()[i] + table.values()[i + 1]));
            assert!((stated * band - chance).abs() < 1e-7, "{i}");
            // Within a piece the function is nearly even.
            assert!((stated / mean.max(1e-3) - 1.0).abs() < 0.1 || mean < 1e-3, "{i}: {stated} {mean}");
        }
    }
}
