//! Nodes and weights for integrals over (0, 1).

/// The Gauss–Legendre rule with `count` nodes in (0, 1); the weights add up to 1. Newton's method on the Legendre
/// polynomial, from the estimate of Abramowitz and Stegun, "Handbook of Mathematical Functions" (1964), 22.16.6.
pub fn gauss_legendre(count: usize) -> Vec<[f64; 2]> {
    let n = count as f64;
    let node = |i: usize| {
        let mut x = (std::f64::consts::PI * (i as f64 + 0.75) / (n + 0.5)).cos();
        let mut slope = 1.0;
        for _ in 0..20 {
            // Three-term recurrence; the derivative from the last two.
            let (mut last, mut value) = (1.0, x);
            for k in 2..=count {
                let k = k as f64;
                (last, value) = (value, ((2.0 * k - 1.0) * x * value - (k - 1.0) * last) / k);
            }
            slope = n * (x * value - last) / (x * x - 1.0);
            x -= value / slope;
        }
        [0.5 - 0.5 * x, 1.0 / ((1.0 - x * x) * slope * slope)]
    };
    (0..count).map(node).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polynomials_are_exact() {
        for count in [2, 8, 16] {
            let nodes = gauss_legendre(count);
            for power in 0..2 * count as i32 {
                let sum: f64 = nodes.iter().map(|[x, w]| w * x.powi(power)).sum();
                assert!((sum * f64::from(power + 1) - 1.0).abs() < 1e-12, "{count} nodes, x^{power}: {sum}");
            }
        }
    }
}
