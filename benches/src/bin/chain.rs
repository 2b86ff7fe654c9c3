//! Times of a chain's acceleration and torque regressor per state, for six and seven revolute joints: one state at a time with the
//! instructions of any processor, and several side by side with the instructions of this machine's processor.

use armgap_bench::serial::arm;
use armgap_core::cpu::{Cpu, Kernel, Level};
use armgap_core::lanes::Lanes;
use armgap_core::number::Number;
use std::hint::black_box;
use std::time::Instant;

/// Number of states per measurement, and number of measurements (`REPEATS`) of which the shortest counts.
const STATES: usize = 4096;
const REPEATS: usize = 30;

/// Shortest time per pass of a loop body, ns. It is a macro because a closure would not be compiled for the instruction set of the function around
/// it.
macro_rules! shortest {
    ($i:ident, $body:block) => {{
        let mut shortest = f64::INFINITY;
        for _ in 0..REPEATS {
            let start = Instant::now();
            for $i in 0..STATES {
                $body
            }
            shortest = f64::min(shortest, start.elapsed().as_secs_f64() * 1e9 / STATES as f64);
        }
        shortest
    }};
}

fn state<const N: usize>(i: usize) -> [[f64; N]; 3] {
    let of = |a: f64| std::array::from_fn(|j| (a * (i * N + j) as f64).sin() * 2.0);
    [of(0.71), of(1.13), of(1.77)]
}

/// Times of acceleration and regressor, ns per state, with `V::WIDTH` states side by side.
#[inline(always)]
fn times<V: Number<Real = f64>, const N: usize>(of: impl Fn(f64) -> V) -> [f64; 2] {
    let (chain, links) = arm::<N>();
    let links = links.map(|link| link.map(&of));
    let rotors = [[of(0.0); N]; N];
    let states: Vec<[[V; N]; 3]> = (0..64).map(|i| state::<N>(i).map(|x| x.map(&of))).collect();
    let acceleration = shortest!(i, {
        let [q, dq, tau] = &states[i % 64];
        black_box(chain.forward_dynamics(black_box(&links), &rotors, [q, dq, tau]));
    });
    let regressor = shortest!(i, {
        let [q, dq, ddq] = black_box(&states[i % 64]);
        let mut matrix = [[[of(0.0); 10]; N]; N];
        chain.torque_regressor([q, dq, ddq], |i, k, row| matrix[i][k] = row);
        black_box(&matrix);
    });
    [acceleration, regressor].map(|time| time / V::WIDTH as f64)
}

/// Kernel that measures with the widest vectors of the processor.
struct Wide<const N: usize>;

impl<const N: usize> Kernel for Wide<N> {
    type Output = [f64; 2];

    #[inline(always)]
    fn run<C: Cpu>(self) -> [f64; 2] {
        match C::DOUBLES {
            8 => times::<Lanes<f64, C, 8>, N>(Lanes::of),
            4 => times::<Lanes<f64, C, 4>, N>(Lanes::of),
            _ => times::<Lanes<f64, C, 2>, N>(Lanes::of),
        }
    }
}

fn print<const N: usize>() {
    let [acceleration, regressor] = times::<f64, N>(|x| x);
    println!(
        "{N} joints, one state:          acceleration {acceleration:6.0} ns, regressor {regressor:6.0} ns"
    );
    for (name, level) in
        [("portable", Level::PORTABLE), ("AVX2", Level::detect()), ("widest", Level::widest())]
    {
        let [acceleration, regressor] = level.run_wide(Wide::<N>);
        println!(
            "{N} joints, lanes {name:9}:    acceleration {acceleration:6.0} ns, regressor {regressor:6.0} ns"
        );
    }
}

fn main() {
    print::<6>();
    print::<7>();
}
