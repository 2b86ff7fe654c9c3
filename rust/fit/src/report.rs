//! dev
use crate::arm::ArmDescription;
use crate::diagnose::Options;
use crate::model::Hypothesis;
use crate::study::Study;
use armgap_core::arm::Arm;
use serde::Serialize;
/// d
#[derive(Debug, Serialize, Default)]
pub struct Diagnosis {
    /// s
    pub seconds: f64,
}
/// c
pub fn compose<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    study: &Study<A, N, P>,
    _arm: &ArmDescription,
    _o: &Options,
) -> Diagnosis {
    let rms = |h: &Hypothesis<P>| -> Vec<f64> {
        let d = &study.holdout.data;
        let p = d.predict(&study.arm, h, &d.measured_starts());
        (0..N)
            .map(|j| {
                (p.iter()
                    .zip(&study.holdout.measured)
                    .skip(j)
                    .step_by(N)
                    .map(|(a, b)| (a - b).powi(2))
                    .sum::<f64>()
                    / d.rows as f64)
                    .sqrt()
            })
            .collect()
    };
    let t0 = std::time::Instant::now();
    let nominal = Hypothesis::rigid(study.prior.theta);
    eprintln!(
        "windows {} {} rows {} noise {:?} step {:?}",
        study.training.data.windows.len(),
        study.holdout.data.windows.len(),
        study.training.data.rows,
        study.noise,
        study.training.data.tracks[0].step
    );
    eprintln!("nominal gap {:?}", rms(&nominal));
    let mut scale = study.rough_scale(&nominal);
    let mut current = nominal;
    for s in 0..3 {
        let stage = study.stage(&current, scale);
        eprintln!(
            "== stage {s} t={:.2}s scale {:?} base gap {:?} excess {:.2} prior {:.1} smoothing {}",
            t0.elapsed().as_secs_f64(),
            stage.weights.training.scale,
            rms(&stage.base.fit.hypothesis),
            stage.excess(),
            stage.base.fit.prior_cost,
            stage.base.fit.hypothesis.smoothing
        );
        let mut sc: Vec<_> = stage.screened.iter().collect();
        sc.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        for x in sc.iter().take(8) {
            eprintln!(
                "   screen {:?} gain {:.1} est {:.4} sig {:.4} distinct {:.4}",
                x.effect, x.gain, x.estimate, x.sigma, x.distinct
            );
        }
        for c in &stage.contenders {
            eprintln!(
                "   {:?} sm {:.4} train {:.1} hold {:.1} prior {:.1} share {:.3} z {:.1} gap {:?}",
                c.effect,
                c.fit.hypothesis.smoothing,
                c.fit.data_cost,
                c.holdout.iter().sum::<f64>(),
                c.fit.prior_cost,
                stage.share(c),
                c.z_over(&stage.base),
                rms(&c.fit.hypothesis)
            );
        }
        let Some(best) = stage.contenders.first() else {
            break;
        };
        if stage.share(best) < 0.1 {
            break;
        }
        current = best.fit.hypothesis.clone();
        scale = stage.weights.training.scale;
    }
    Diagnosis::default()
}
