//! Estimator of a serial arm in the caller's memory, of the smallest [`ChainSize`] that has room for the arm.

use crate::chain::{ARMGAP_CHAIN_VERSION, armgap_chain_settings, armgap_joint};
use crate::settings::{armgap_report, armgap_status, status_of};
use crate::slot::{answer, fill_report, give, outcome, slice, usable};
use armgap_core::chain::{ChainJoint, JointKind, MAX_JOINTS, PARAMETERS_PER_JOINT};
use armgap_core::online::{
    ChainEstimator, ChainSettings, ChainSize, LargeChain, MediumChain, OnlineEstimator, SmallChain, When,
};
use armgap_core::real::{Real, lit};
use armgap_status::{ARMGAP_LENGTH, ARMGAP_NOT_STARTED, ARMGAP_OK, ARMGAP_RANGE, ARMGAP_VERSION};
use core::ffi::c_void;

/// Largest number of estimated parameters of a serial arm.
const MOST: usize = ChainSize::Large.room()[1];
/// First word of memory that holds an estimator of a serial arm of this version, before size and precision are mixed in.
const MARK: u64 = 0x4d47_5241_0002_0000;

/// Contents of the caller's memory: a mark and an estimator of a serial arm.
#[repr(C)]
struct Slot<E> {
    mark: u64,
    estimator: E,
}

/// Mark by which memory with an estimator of this size, in the precision of `T`, is recognised.
const fn mark<T>(size: ChainSize) -> u64 {
    MARK ^ ((size_of::<T>() as u64) << 8) ^ (size as u64)
}

/// Smallest size of estimator for this number of joints and parameters; `None` if there is none.
fn size_of_chain(joints: u32, parameters: u32) -> Option<ChainSize> {
    if joints == 0 || parameters == 0 { None } else { ChainSize::of(joints as usize, parameters as usize) }
}

/// Bytes of an estimator for this number of joints and parameters in the precision of `T`; 0 if there is none.
pub(crate) fn size<T: Real>(joints: u32, parameters: u32) -> usize {
    match size_of_chain(joints, parameters) {
        Some(ChainSize::Small) => size_of::<Slot<SmallChain<T>>>(),
        Some(ChainSize::Medium) => size_of::<Slot<MediumChain<T>>>(),
        Some(ChainSize::Large) => size_of::<Slot<LargeChain<T>>>(),
        None => 0,
    }
}

/// The caller's memory as a slot of the largest size, checked for null and alignment; all sizes have the same alignment.
fn slot_in<T: Real>(memory: *const c_void) -> Result<*const Slot<LargeChain<T>>, armgap_status> {
    let slot = memory.cast::<Slot<LargeChain<T>>>();
    usable(slot)?;
    Ok(slot)
}

/// Joint of the C interface as `armgap-core` takes it; `None` if its kind is unknown.
fn joint_of<T: Real>(joint: &armgap_joint) -> Option<ChainJoint<T>> {
    let kind = *[JointKind::Revolute, JointKind::Prismatic].get(joint.kind as usize)?;
    let [xx, xy, xz, yx, yy, yz, zx, zy, zz] = joint.rotation;
    let rotation = [[xx, xy, xz], [yx, yy, yz], [zx, zy, zz]].map(|row| row.map(lit));
    let (translation, axis) = (joint.translation.map(lit), joint.axis.map(lit));
    Some(ChainJoint { kind, rotation, translation, axis })
}

pub(crate) unsafe fn start<T: Real>(
    memory: *mut c_void,
    size: usize,
    settings: *const armgap_chain_settings,
    joints: *const armgap_joint,
    columns: *const u32,
    known: *const f64,
    theta0: *const T,
) -> armgap_status {
    answer((|| {
        slot_in::<T>(memory)?;
        usable(settings)?;
        // SAFETY: checked above.
        let settings = unsafe { &*settings };
        if settings.version != ARMGAP_CHAIN_VERSION {
            return Err(ARMGAP_VERSION);
        }
        let common = settings.common::<T>().ok_or(ARMGAP_RANGE)?;
        let which = size_of_chain(settings.joints, settings.parameters).ok_or(ARMGAP_RANGE)?;
        if size < self::size::<T>(settings.joints, settings.parameters) {
            return Err(ARMGAP_LENGTH);
        }
        let (n, r) = (settings.joints as usize, settings.parameters as usize);
        let none = ChainJoint {
            kind: JointKind::Revolute,
            rotation: [[T::zero(); 3]; 3],
            translation: [T::zero(); 3],
            axis: [T::zero(); 3],
        };
        let (mut chain, mut chosen) = ([none; MAX_JOINTS], [0_usize; MOST]);
        let mut values = [T::zero(); PARAMETERS_PER_JOINT * MAX_JOINTS];
        for (joint, given) in chain.iter_mut().zip(unsafe { slice(joints, n, MAX_JOINTS)? }) {
            *joint = joint_of(given).ok_or(ARMGAP_RANGE)?;
        }
        for (column, given) in chosen.iter_mut().zip(unsafe { slice(columns, r, MOST)? }) {
            *column = *given as usize;
        }
        if !known.is_null() {
            let known = unsafe { slice(known, PARAMETERS_PER_JOINT * n, PARAMETERS_PER_JOINT * MAX_JOINTS)? };
            for (value, given) in values.iter_mut().zip(known) {
                *value = lit(*given);
            }
        }
        let theta0 = if theta0.is_null() { &[] } else { unsafe { slice(theta0, r, MOST)? } };
        let settings = ChainSettings {
            common,
            joints: chain.get(..n).ok_or(ARMGAP_RANGE)?,
            gravity: settings.gravity.map(lit),
            columns: chosen.get(..r).ok_or(ARMGAP_RANGE)?,
            known: values.get(..PARAMETERS_PER_JOINT * n).ok_or(ARMGAP_RANGE)?,
        };
        // SAFETY: not null, aligned, and as large as a slot of this size.
        unsafe {
            match which {
                ChainSize::Small => write::<T, 2, 26, 20>(memory, which, &settings, theta0),
                ChainSize::Medium => write::<T, 4, 52, 40>(memory, which, &settings, theta0),
                ChainSize::Large => write::<T, 7, 91, 72>(memory, which, &settings, theta0),
            }
        }
    })())
}

/// Writes an estimator that has taken no sample, with its mark, into the caller's memory.
#[inline(never)]
unsafe fn write<T: Real, const N: usize, const P: usize, const R: usize>(
    memory: *mut c_void,
    size: ChainSize,
    settings: &ChainSettings<'_, T>,
    theta0: &[T],
) -> Result<armgap_status, armgap_status> {
    let estimator = ChainEstimator::<T, N, P, R>::of_chain(settings, theta0).map_err(status_of)?;
    unsafe { memory.cast::<Slot<_>>().write(Slot { mark: mark::<T>(size), estimator }) };
    Ok(ARMGAP_OK)
}

/// Size of the estimator in the caller's memory by its mark, or the status if there is no estimator.
unsafe fn marked<T: Real>(memory: *const c_void) -> Result<ChainSize, armgap_status> {
    let slot = slot_in::<T>(memory)?;
    // SAFETY: the mark is read alone first, from memory that is large enough for it.
    let found = unsafe { (&raw const (*slot).mark).read() };
    ChainSize::ALL.into_iter().find(|size| mark::<T>(*size) == found).ok_or(ARMGAP_NOT_STARTED)
}

/// Estimator in the caller's memory, or the status if there is none.
unsafe fn opened<'a, T: Real>(memory: *const c_void) -> Result<&'a dyn OnlineEstimator<T>, armgap_status> {
    // SAFETY: marked memory was written by `start` with a slot of the size that the mark says.
    unsafe {
        Ok(match marked::<T>(memory)? {
            ChainSize::Small => &(*memory.cast::<Slot<SmallChain<T>>>()).estimator,
            ChainSize::Medium => &(*memory.cast::<Slot<MediumChain<T>>>()).estimator,
            ChainSize::Large => &(*memory.cast::<Slot<LargeChain<T>>>()).estimator,
        })
    }
}

/// Estimator in the caller's memory to take a sample, or the status if there is none.
unsafe fn opened_mut<'a, T: Real>(
    memory: *mut c_void,
) -> Result<&'a mut dyn OnlineEstimator<T>, armgap_status> {
    // SAFETY: as above; nobody else holds it during this call.
    unsafe {
        Ok(match marked::<T>(memory)? {
            ChainSize::Small => &mut (*memory.cast::<Slot<SmallChain<T>>>()).estimator,
            ChainSize::Medium => &mut (*memory.cast::<Slot<MediumChain<T>>>()).estimator,
            ChainSize::Large => &mut (*memory.cast::<Slot<LargeChain<T>>>()).estimator,
        })
    }
}

pub(crate) unsafe fn update<T: Real>(
    memory: *mut c_void,
    when: When<T>,
    q: *const T,
    dq: *const T,
    tau: *const T,
    joints: usize,
) -> armgap_status {
    answer((|| {
        let estimator = unsafe { opened_mut::<T>(memory)? };
        let (q, tau) = unsafe { (slice(q, joints, MAX_JOINTS)?, slice(tau, joints, MAX_JOINTS)?) };
        let dq = if dq.is_null() { None } else { Some(unsafe { slice(dq, joints, MAX_JOINTS)? }) };
        estimator.update(when, q, dq, tau).map(outcome).map_err(status_of)
    })())
}

pub(crate) unsafe fn theta<T: Real>(memory: *const c_void, to: *mut T, count: usize) -> armgap_status {
    answer((|| unsafe { give(opened::<T>(memory)?.theta(), to, count) })())
}

pub(crate) unsafe fn errors<T: Real>(memory: *const c_void, to: *mut T, count: usize) -> armgap_status {
    answer((|| unsafe { give(opened::<T>(memory)?.errors(), to, count) })())
}

pub(crate) unsafe fn variances<T: Real>(memory: *const c_void, to: *mut T, count: usize) -> armgap_status {
    answer((|| {
        let mut variances = [T::zero(); MOST];
        let parameters = unsafe { opened::<T>(memory)? }.variances(&mut variances);
        unsafe { give(variances.get(..parameters).unwrap_or(&variances), to, count) }
    })())
}

pub(crate) unsafe fn sigma<T: Real>(memory: *const c_void, to: *mut T, count: usize) -> armgap_status {
    answer((|| {
        let mut sigma = [T::zero(); MOST];
        let parameters = unsafe { opened::<T>(memory)? }.sigma(&mut sigma);
        unsafe { give(sigma.get(..parameters).unwrap_or(&sigma), to, count) }
    })())
}

pub(crate) unsafe fn report<T: Real>(memory: *const c_void, to: *mut armgap_report) -> armgap_status {
    answer((|| unsafe { fill_report(opened::<T>(memory)?, to) })())
}
