//! Fits an avatar to a synthetic arm for a few steps: `cargo run --release -p skinsplat-fit --example fit_a_few_steps`.

use skinsplat_fit::train::{self, Step, Trainer};
use skinsplat_fit::{FitOptions, Recipe};
use skinsplat_synthetic::{ArmShape, Parameters, Rig, Subject};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let rig = Rig::Arm(ArmShape::default());
    let parameters = Parameters { rig, resolution: 96, train_frames: 8, ..Parameters::default() };
    let subject = Subject::new(&parameters)?;
    let sequence = &subject.train()[0];
    // Any number of a recipe can be varied: what is fitted, learning rates, the loss.
    let recipe = Recipe::parse("hugs-skinned+loss.ssim=0.1")?;
    let options = FitOptions { recipe, iterations: 64, seed: 0, edge_mm: 15 };
    let mut trainer = Trainer::new(sequence, &options, train::start(sequence, &options)?.avatar)?;
    let mut steps: Vec<Step> = Vec::new();
    while !trainer.is_done() {
        steps.push(trainer.step()?);
    }
    // Every step sees another frame: compare means over all of them.
    let epoch = sequence.frames.len();
    report("before", &steps[..epoch]);
    report("after", &steps[steps.len() - epoch..]);
    Ok(())
}

#[expect(clippy::print_stdout, reason = "an example")]
fn report(when: &str, steps: &[Step]) {
    let mean = |value: fn(&Step) -> f64| steps.iter().map(value).sum::<f64>() / steps.len() as f64;
    let splats = steps.last().map_or(0, |step| step.splats);
    println!("{when:>6}: loss {:.5}, PSNR {:.2} dB, {splats} Gaussians", mean(|s| s.loss), mean(|s| s.psnr));
}
