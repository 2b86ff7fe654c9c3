//! Times of a chain's acceleration, inverse dynamics and torque regressor per state, for six and seven revolute joints: one state at a time, and
//! several side by side with the instructions of this machine's processor. With the feature `pinocchio` those of Pinocchio in C++ beside them, in
//! turns, with the ratios of the medians; both are compiled for any processor, or with `RUSTFLAGS="-C target-cpu=native"` for this machine's.

use armgap_bench::serial::arm;
use armgap_core::chain::{Chain, InertiaMatrix, LinkInertia};
use armgap_core::cpu::{Cpu, Kernel, Level};
use armgap_core::lanes::Lanes;
use armgap_core::number::Number;
use std::hint::black_box;
use std::time::Instant;

/// Number of different states, of evaluations per measurement (short beside the time slices of a busy machine), and of measurements of each
/// computation.
const RING: usize = 64;
const PASSES: usize = 256;
const ROUNDS: usize = 400;
/// Largest relative difference of results that are the same but for rounding.
const SAME: f64 = 1e-10;

/// Position, velocity, and torque or acceleration.
type State<V, const N: usize> = [[V; N]; 3];

/// Regressor, one row of ten numbers for each joint and link.
type Regressor<V, const N: usize> = [[LinkInertia<V>; N]; N];

/// States of the ring, SI.
fn ring<const N: usize>() -> Vec<State<f64, N>> {
    let of = |a: f64, i: usize| std::array::from_fn(|j| (a * (i * N + j) as f64).sin() * 2.0);
    (0..RING).map(|i| [of(0.71, i), of(1.13, i), of(1.77, i)]).collect()
}

/// What is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Quantity {
    Acceleration,
    InverseDynamics,
    Regressor,
}

impl Quantity {
    fn name(self) -> &'static str {
        match self {
            Self::Acceleration => "acceleration",
            Self::InverseDynamics => "inverse dynamics",
            Self::Regressor => "torque regressor",
        }
    }
}

/// Arm with a ring of states, `V::WIDTH` of them side by side, and room for results.
struct Bench<V, const N: usize> {
    chain: Chain<f64, N>,
    links: [LinkInertia<V>; N],
    rotors: InertiaMatrix<V, N>,
    states: Vec<State<V, N>>,
    vector: [V; N],
    regressor: Box<Regressor<V, N>>,
}

impl<V: Number<Real = f64>, const N: usize> Bench<V, N> {
    /// Arm with a ring of states; `side_by_side` puts numbers of `V::WIDTH` states into lanes.
    #[inline(always)]
    fn new(side_by_side: impl Fn(&dyn Fn(usize) -> f64) -> V) -> Self {
        let ((chain, links), ring, zero) = (arm::<N>(), ring::<N>(), V::of(0.0));
        let state = |i: usize| {
            let entry = |k: usize, j: usize| side_by_side(&|lane| ring[(i * V::WIDTH + lane) % RING][k][j]);
            [0, 1, 2].map(|k| std::array::from_fn(|j| entry(k, j)))
        };
        Self {
            chain,
            links: links.map(|link| link.map(V::of)),
            rotors: [[zero; N]; N],
            states: (0..RING / V::WIDTH).map(state).collect(),
            vector: [zero; N],
            regressor: Box::new([[[zero; 10]; N]; N]),
        }
    }

    /// Evaluates `quantity` for `passes` states of the ring; the result of the last remains.
    #[inline(always)]
    fn run(&mut self, quantity: Quantity, passes: usize) {
        let Self { chain, links, rotors, states, vector, regressor } = self;
        let count = states.len();
        for i in 0..passes {
            let [q, dq, x] = &states[i % count];
            let (chain, links) = (black_box(&*chain), black_box(&*links));
            match quantity {
                Quantity::Acceleration => *vector = chain.forward_dynamics(links, rotors, [q, dq, x]),
                Quantity::InverseDynamics => *vector = chain.inverse_dynamics(links, q, dq, x),
                Quantity::Regressor => chain.torque_regressor([q, dq, x], |i, k, row| regressor[i][k] = row),
            }
            black_box(&mut *vector);
            black_box(&mut **regressor);
        }
    }
}

/// Kernel that takes as many states side by side as fill a vector of the processor.
struct Pass<'a, const N: usize> {
    quantity: Quantity,
    /// Number of states, a multiple of that side by side.
    passes: usize,
    /// Receives the numbers of the last state.
    out: &'a mut Vec<f64>,
}

impl<const N: usize> Pass<'_, N> {
    /// Time per state, ns.
    #[inline(always)]
    fn on<C: Cpu, const W: usize>(self) -> f64 {
        let mut bench = Bench::<Lanes<f64, C, W>, N>::new(|of| Lanes::new(std::array::from_fn(of)));
        bench.run(self.quantity, bench.states.len());
        let start = Instant::now();
        bench.run(self.quantity, self.passes / W);
        let time = start.elapsed().as_secs_f64() * 1e9 / self.passes as f64;
        let numbers = match self.quantity {
            Quantity::Regressor => bench.regressor.as_flattened().as_flattened(),
            _ => &bench.vector,
        };
        *self.out = numbers.iter().map(|x| x.0[W - 1]).collect();
        time
    }
}

impl<const N: usize> Kernel for Pass<'_, N> {
    type Output = f64;

    #[inline(always)]
    fn run<C: Cpu>(self) -> f64 {
        match C::DOUBLES {
            8 => self.on::<C, 8>(),
            4 => self.on::<C, 4>(),
            _ => self.on::<C, 2>(),
        }
    }
}

/// Time per state, ns, one state at a time.
#[inline(never)]
fn one_at_a_time<const N: usize>(quantity: Quantity, passes: usize, out: &mut Vec<f64>) -> f64 {
    let mut bench = Bench::<f64, N>::new(|of| of(0));
    bench.run(quantity, RING);
    let start = Instant::now();
    bench.run(quantity, passes);
    let time = start.elapsed().as_secs_f64() * 1e9 / passes as f64;
    *out = match quantity {
        Quantity::Regressor => bench.regressor.as_flattened().as_flattened().to_vec(),
        _ => bench.vector.to_vec(),
    };
    time
}

/// Measurement of a computation for a number of states, a multiple of eight: returns the time per state, ns, and writes the numbers of the last.
type Measure = Box<dyn FnMut(usize, &mut Vec<f64>) -> f64>;

/// Computations of a quantity; those of Pinocchio come last.
fn computations<const N: usize>(quantity: Quantity) -> Vec<(&'static str, Measure)> {
    let single = move |passes, out: &mut Vec<f64>| one_at_a_time::<N>(quantity, passes, out);
    let mut all: Vec<(&'static str, Measure)> = vec![("one state at a time", Box::new(single))];
    for (name, level) in [
        ("lanes, any processor", Level::PORTABLE),
        ("lanes, AVX2", Level::detect()),
        ("lanes, widest", Level::widest()),
    ] {
        let pass = move |passes, out: &mut Vec<f64>| level.run_wide(Pass::<N> { quantity, passes, out });
        all.push((name, Box::new(pass)));
    }
    #[cfg(pinocchio)]
    all.extend(beside::computations::<N>(quantity));
    all
}

/// Pinocchio's computations of the same quantities.
#[cfg(pinocchio)]
mod beside {
    use super::{Measure, Quantity, RING, ring};
    use armgap_bench::serial::arm;
    use armgap_benches::pinocchio::{Algorithm, Arm};
    use std::time::Instant;

    pub fn computations<const N: usize>(quantity: Quantity) -> Vec<(&'static str, Measure)> {
        let algorithms: &[_] = match quantity {
            Quantity::Acceleration => &[
                ("Pinocchio aba, LOCAL", Algorithm::AbaLocal),
                ("Pinocchio aba, WORLD", Algorithm::AbaWorld),
            ],
            Quantity::InverseDynamics => &[("Pinocchio rnea", Algorithm::Rnea)],
            Quantity::Regressor => &[("Pinocchio computeJointTorqueRegressor", Algorithm::Regressor)],
        };
        let measure = |&(name, algorithm): &(&'static str, Algorithm)| {
            let (chain, links) = arm::<N>();
            let pinocchio = Arm::new(&chain, &links, &ring::<N>());
            let pass = move |passes: usize, out: &mut Vec<f64>| {
                pinocchio.run(algorithm, RING);
                let start = Instant::now();
                *out = pinocchio.run(algorithm, passes);
                start.elapsed().as_secs_f64() * 1e9 / passes as f64
            };
            (name, Box::new(pass) as Measure)
        };
        algorithms.iter().map(measure).collect()
    }
}

fn median(times: &[f64]) -> f64 {
    let mut sorted = times.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted[sorted.len() / 2]
}

/// Largest difference of `x` from `y` relative to the largest number of `y`.
fn difference(x: &[f64], y: &[f64]) -> f64 {
    let largest = |values: &mut dyn Iterator<Item = f64>| values.fold(0.0, |a: f64, b| a.max(b.abs()));
    largest(&mut x.iter().zip(y).map(|(x, y)| x - y)) / largest(&mut y.iter().copied())
}

/// Largest relative difference of the results of each computation from those of the last one.
fn differences(all: &mut [(&'static str, Measure)]) -> Vec<f64> {
    let mut largest = vec![0.0; all.len()];
    for passes in (8..=RING).step_by(8) {
        let numbers = all.iter_mut().map(|(_, measure)| {
            let mut numbers = Vec::new();
            measure(passes, &mut numbers);
            numbers
        });
        let numbers: Vec<_> = numbers.collect();
        for (off, own) in largest.iter_mut().zip(&numbers) {
            *off = f64::max(*off, numbers.last().map_or(0.0, |last| difference(own, last)));
        }
    }
    largest
}

/// Measures all computations of a quantity in turns and prints a table.
///
/// # Panics
/// If results differ by more than rounding.
fn compare<const N: usize>(quantity: Quantity) {
    let mut all = computations::<N>(quantity);
    let differences = differences(&mut all);
    let (mut times, mut numbers) = (vec![Vec::new(); all.len()], Vec::new());
    for _ in 0..ROUNDS {
        for (k, (_, measure)) in all.iter_mut().enumerate() {
            times[k].push(measure(PASSES, &mut numbers));
        }
    }
    let medians: Vec<f64> = times.iter().map(|times| median(times)).collect();
    // The fastest of Pinocchio's ways, or one state at a time.
    let pinocchio = (0..all.len()).filter(|&k| all[k].0.starts_with("Pinocchio"));
    let base = pinocchio.min_by(|&a, &b| medians[a].total_cmp(&medians[b])).unwrap_or(0);
    let least: Vec<f64> =
        times.iter().map(|times| times.iter().copied().fold(f64::INFINITY, f64::min)).collect();
    println!(
        "| {N} joints, {} | median | least | medians / {} | least | differ |",
        quantity.name(),
        all[base].0
    );
    println!("| --- | ---: | ---: | ---: | ---: | ---: |");
    for (k, (name, _)) in all.iter().enumerate() {
        let ratios = [medians[k] / medians[base], least[k] / least[base]];
        println!(
            "| {name} | {:.0} ns | {:.0} ns | {:.2} | {:.2} | {:.0e} |",
            medians[k], least[k], ratios[0], ratios[1], differences[k]
        );
        assert!(differences[k] < SAME, "{name}: results differ by {:e}", differences[k]);
    }
    println!();
}

fn main() {
    #[cfg(pinocchio)]
    println!("Pinocchio by {}\n", env!("PINOCCHIO_COMPILER"));
    #[cfg(not(pinocchio))]
    println!("skipped Pinocchio: {}\n", env!("PINOCCHIO_MISSING"));
    for quantity in [Quantity::Acceleration, Quantity::InverseDynamics, Quantity::Regressor] {
        compare::<6>(quantity);
        compare::<7>(quantity);
    }
}
