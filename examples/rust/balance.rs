//! Three links that stand on a cart: a controller in Rust pushes the cart, a hundred times a second.
//!
//! The model comes as a text, which pendula interprets; there is no compiler in between:
//!
//!     PYTHONPATH=~/.local/share/pendula/codegen python3 -m pendula_codegen program \
//!         --model cart_chain --links 3 --as bytecode --output cart_chain_3.program
//!     rustc --edition 2021 -O balance.rs -L ~/.local/lib -C link-arg=-Wl,-rpath,$HOME/.local/lib
//!     ./balance cart_chain_3.program

mod pendula;

use pendula::{Model, Simulation};
use std::cell::Cell;
use std::error::Error;
use std::f64::consts::PI;
use std::{env, fs};

/// The force on the cart  [N]
fn push(q: &[f64], v: &[f64]) -> f64 {
    let by_q = [1.0, -639.0, 1734.0, -1219.0];
    let by_v = [4.3, -40.1, 202.0, -244.2];
    let upright = [0.0, PI, PI, PI];
    let force: f64 = (0..4)
        .map(|k| by_q[k] * (q[k] - upright[k]) + by_v[k] * v[k])
        .sum();
    force.clamp(-100.0, 100.0)
}

fn main() -> Result<(), Box<dyn Error>> {
    let file = env::args().nth(1).ok_or("usage: balance FILE.program")?;
    let cart = Model::of_program(&fs::read_to_string(file)?)?;
    let start = [
        0.0,
        181.0_f64.to_radians(),
        182.0_f64.to_radians(),
        181.0_f64.to_radians(),
    ];

    let swings = Cell::new(0);
    let mut run = Simulation::new(&cart, &start, &[0.0; 4], 1e-12)?;
    run.on(|_, q, _| q[1] - PI, |_, _, _| swings.set(swings.get() + 1))?;
    for k in 0..=2000 {
        run.advance_to(0.01 * f64::from(k))?;
        let (q, v) = run.motion();
        run.hold(&[push(&q, &v)])?;
    }

    for ((name, unit), number) in cart.columns().iter().zip(run.row()?) {
        println!("{name} {number:.17e} {unit}");
    }
    println!("events {}", swings.get());
    Ok(())
}
