//! The scalar type: `f64` on a desktop, `f32` on a controller.

use nalgebra::RealField;

/// A real number the core computes with: `f32` or `f64`.
pub trait Real: RealField + Copy {}
impl<T: RealField + Copy> Real for T {}

/// A literal constant in the scalar type `T`.
#[inline]
pub fn lit<T: Real>(x: f64) -> T {
    nalgebra::convert(x)
}

/// Sign with `sgn(0) = 0`, as Coulomb friction at rest exerts no torque of its own.
#[inline]
pub fn sgn<T: Real>(x: T) -> T {
    if x > T::zero() {
        T::one()
    } else if x < T::zero() {
        -T::one()
    } else {
        T::zero()
    }
}
