#[path = "../benches/rig/mod.rs"]
#[allow(dead_code)]
mod rig;
use skinsplat::scene::PosedBody;
use skinsplat::strategy::{BoundAvatar, PRESETS, Strategy, pose};
use std::time::Instant;
fn main() {
    let only: Vec<String> = std::env::args().skip(1).collect();
    let body = rig::body();
    let pb = PosedBody::new(&body, &rig::pose(&body)).unwrap();
    pb.mesh();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    for degree in [0, 3] {
        for (name, avatar) in [
            ("14k-v", rig::on_vertices(&body, degree)),
            ("100k-v", rig::scattered(&body, degree)),
            ("100k-f", rig::on_faces(&body, degree)),
        ] {
            let t = Instant::now();
            let bound = BoundAvatar::new(&avatar, &body).unwrap();
            let tb = t.elapsed();
            println!("{name} degree {degree}: bind {:?}", tb);
            let mut specs: Vec<String> = PRESETS.iter().map(|p| p.id.to_string()).collect();
            if !only.is_empty() {
                specs = only.clone();
            }
            for spec in specs {
                let s: Strategy = spec.parse().unwrap();
                let mut best = f64::MAX;
                pool.install(|| {
                    for _ in 0..25 {
                        let t = Instant::now();
                        std::hint::black_box(pose(&bound, &pb, &s).unwrap());
                        best = best.min(t.elapsed().as_secs_f64());
                    }
                });
                println!("   {:<28} {:7.1} ns", spec, best * 1e9 / bound.len() as f64);
            }
        }
    }
}
