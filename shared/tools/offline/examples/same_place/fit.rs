//! Logistic regression on steps of quantities, each with the sign that it must have: a weight that is monotone.

use std::collections::BTreeMap;
use std::error::Error;

/// A step of a quantity: where it begins, and the sign of what it adds.
struct FittedStep {
    quantity: usize,
    from: f64,
    sign: f64,
}

/// Where steps are, by quantity in the order of `PlaceEvidence::quantities`, and the sign of their weights.
const STEPS: [(&[f64], f64); 8] = [
    (&[12.0, 20.0, 40.0, 80.0], 1.0),
    (&[0.1, 0.2, 0.4, 0.7, 1.0], 1.0),
    (&[10.0, 20.0, 40.0, 80.0], -1.0),
    (&[0.2, 0.4, 0.6, 0.8], 1.0),
    (&[0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9], 1.0),
    (&[0.01, 0.02, 0.05, 0.1, 0.2, 0.4], -1.0),
    (&[0.5, 0.6, 0.7, 0.8, 1.0, 1.5], -1.0),
    (&[0.005, 0.01, 0.02, 0.05, 0.1], 1.0),
];
/// Quantities that concern features.
const N_OF_FEATURES: usize = 3;
/// Standard deviation of a step's weight before anything is known of it, nats: wide beside what the pairs tell.
const PRIOR_NATS: f64 = 6.0;
const SWEEPS: usize = 300;

/// A pair with its answer.
struct Labelled {
    sequence: String,
    is_same: bool,
    has_features: bool,
    quantities: [f64; 8],
    /// All worlds count the same, and both answers.
    weight: f64,
}

/// The weights of a table.
struct Fitted {
    constant: f64,
    steps: Vec<(FittedStep, f64)>,
}

impl Fitted {
    fn llr_nats(&self, pair: &Labelled) -> f64 {
        let steps = self.steps.iter().filter(|(step, _)| pair.quantities[step.quantity] >= step.from);
        self.constant + steps.map(|(_, weight)| weight).sum::<f64>()
    }
}

/// A table: its name, the quantities that it weighs, and which pairs it is fitted to.
struct FitTable {
    name: &'static str,
    quantities: std::ops::Range<usize>,
    is_of: fn(&Labelled) -> bool,
}

const TABLES: [FitTable; 3] = [
    FitTable { name: "WITH_FEATURES", quantities: 0..8, is_of: |pair| pair.has_features },
    FitTable { name: "SHAPE", quantities: N_OF_FEATURES..8, is_of: |_| true },
    FitTable { name: "ALIKE", quantities: 0..N_OF_FEATURES, is_of: |pair| pair.has_features && fits(pair) },
];

/// Whether the surfaces of a pair fit as those of one place do: two fifths in view, half of them matched, a tenth in
/// front of what the other saw at most.
fn fits(pair: &Labelled) -> bool {
    let [.., overlap, matched, in_front, _, _] = pair.quantities;
    overlap >= 0.4 && matched >= 0.5 && in_front <= 0.1
}

pub(crate) fn run(fitted_on: &str, checked_on: &str) -> Result<(), Box<dyn Error>> {
    for table in &TABLES {
        let fitted = fit(&read(fitted_on, table.is_of)?, table.quantities.clone());
        print_table(table.name, &fitted);
        for file in [fitted_on, checked_on] {
            check(file, &read(file, table.is_of)?, &fitted);
        }
    }
    Ok(())
}

fn read(file: &str, is_of: fn(&Labelled) -> bool) -> Result<Vec<Labelled>, Box<dyn Error>> {
    let mut pairs = Vec::new();
    for line in std::fs::read_to_string(file)?.lines() {
        let fields: Vec<&str> = line.split(',').collect();
        let [sequence, is_same, has_features, numbers @ ..] = fields.as_slice() else { continue };
        let numbers: Vec<f64> = numbers.iter().map(|n| n.parse()).collect::<Result<_, _>>()?;
        pairs.push(Labelled {
            sequence: (*sequence).to_owned(),
            is_same: *is_same == "1",
            has_features: *has_features == "1",
            quantities: numbers.try_into().map_err(|_| format!("{file}: {line}: expected 8 quantities"))?,
            weight: 0.0,
        });
    }
    pairs.retain(|pair| is_of(pair) && !is_twin(pair));
    let key = |pair: &Labelled| (pair.sequence.clone(), pair.is_same);
    let mut n: BTreeMap<(String, bool), f64> = BTreeMap::new();
    pairs.iter().for_each(|pair| *n.entry(key(pair)).or_default() += 1.0);
    // As many pairs in all as there are, the worlds of an answer alike.
    let worlds = [false, true].map(|is_same| n.keys().filter(|(_, same)| *same == is_same).count() as f64);
    let half = pairs.len() as f64 / 2.0;
    for pair in &mut pairs {
        pair.weight = half / worlds[usize::from(pair.is_same)] / n[&key(pair)];
    }
    Ok(pairs)
}

/// Whether a pair shows rooms of the simulated building that are the same to a camera: no pair of views tells them
/// apart, so that it says nothing of how the quantities do.
fn is_twin(pair: &Labelled) -> bool {
    pair.sequence == "building" && !pair.is_same && pair.quantities[0] >= 12.0
}

/// Newton steps of one weight after the other, each kept to its sign.
fn fit(pairs: &[Labelled], quantities: std::ops::Range<usize>) -> Fitted {
    let steps = (0..).zip(STEPS).filter(|(quantity, _)| quantities.contains(quantity));
    let steps = steps.flat_map(|(quantity, (from, sign))| {
        from.iter().map(move |&from| (FittedStep { quantity, from, sign }, 0.0))
    });
    let mut fitted = Fitted { constant: 0.0, steps: steps.collect() };
    let mut llr: Vec<f64> = vec![0.0; pairs.len()];
    for _ in 0..SWEEPS {
        for place in 0..=fitted.steps.len() {
            let (mut gradient, mut curvature) = (0.0, 1e-9);
            let is_in = |pair: &Labelled| match place.checked_sub(1) {
                Some(k) => pair.quantities[fitted.steps[k].0.quantity] >= fitted.steps[k].0.from,
                None => true,
            };
            for (pair, llr) in pairs.iter().zip(&llr).filter(|(pair, _)| is_in(pair)) {
                let p = 1.0 / (1.0 + (-llr).exp());
                gradient += pair.weight * (f64::from(u8::from(pair.is_same)) - p);
                curvature += pair.weight * p * (1.0 - p);
            }
            let before = place.checked_sub(1).map_or(fitted.constant, |k| fitted.steps[k].1);
            let prior = 1.0 / (PRIOR_NATS * PRIOR_NATS);
            let mut after = before + ((gradient - prior * before) / (curvature + prior)).clamp(-1.0, 1.0);
            if let Some(k) = place.checked_sub(1) {
                after = fitted.steps[k].0.sign * (fitted.steps[k].0.sign * after).max(0.0);
            }
            let change = after - before;
            for (pair, llr) in pairs.iter().zip(&mut llr).filter(|(pair, _)| is_in(pair)) {
                let _ = pair;
                *llr += change;
            }
            match place.checked_sub(1) {
                Some(k) => fitted.steps[k].1 = after,
                None => fitted.constant = after,
            }
        }
    }
    fitted
}

fn print_table(name: &str, fitted: &Fitted) {
    println!("pub(crate) const {name}: WeightTable = WeightTable {{");
    println!("    constant_nats: {:.2},", fitted.constant);
    println!("    steps: &[");
    for (FittedStep { quantity, from, .. }, nats) in
        fitted.steps.iter().filter(|(_, nats)| nats.abs() >= 0.005)
    {
        println!("        step({quantity}, {from:?}, {nats:.2}),");
    }
    println!("    ],\n}};");
}

/// Log loss, errors, and the answers in bins of the ratio.
fn check(file: &str, pairs: &[Labelled], fitted: &Fitted) {
    let mut by_sequence: BTreeMap<&str, [f64; 4]> = BTreeMap::new();
    let mut bins: BTreeMap<i64, [f64; 3]> = BTreeMap::new();
    let (mut loss, mut sum) = (0.0, 0.0);
    for pair in pairs {
        let llr = fitted.llr_nats(pair);
        let signed = if pair.is_same { llr } else { -llr };
        loss += pair.weight * (-signed).exp().ln_1p();
        sum += pair.weight;
        let bin = bins.entry((llr / 2.0).floor() as i64).or_default();
        bin[usize::from(pair.is_same)] += 1.0;
        bin[2] += pair.weight * if pair.is_same { 1.0 } else { -1.0 };
        let of = by_sequence.entry(&pair.sequence).or_default();
        of[usize::from(pair.is_same)] += 1.0;
        of[2 + usize::from(pair.is_same)] += f64::from(u8::from(signed < 0.0));
    }
    println!("// {file}: {} pairs, log loss {:.4} nats", pairs.len(), loss / sum);
    for (sequence, [other, same, wrong_other, wrong_same]) in by_sequence {
        println!(
            "//   {sequence}: {same} same ({wrong_same} below 0), {other} other ({wrong_other} above 0)"
        );
    }
    let mut weights: BTreeMap<i64, [f64; 2]> = BTreeMap::new();
    for pair in pairs {
        let bin = (fitted.llr_nats(pair) / 2.0).floor() as i64;
        weights.entry(bin).or_default()[usize::from(pair.is_same)] += pair.weight;
    }
    for (bin, [other, same, _]) in bins {
        let [w_other, w_same] = weights[&bin];
        let observed = (w_same.max(1e-3) / w_other.max(1e-3)).ln();
        println!(
            "//   ratio {:>3} to {:>3}: {same:>6} same, {other:>6} other, observed {observed:+.1}",
            2 * bin,
            2 * bin + 2
        );
    }
}
