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

/// Mark by which memory with an estimator of this size, in the precision of `T`, at this place in it is recognised.
const fn mark<T>(size: ChainSize, place: usize) -> u64 {
    MARK ^ ((place as u64) << 16) ^ ((size_of::<T>() as u64) << 8) ^ (size as u64)
}

/// Place of the estimator in the caller's memory, bytes from its start: the first behind the mark that has the alignment of an estimator. All sizes
/// have the same alignment; the caller's memory needs that of the mark only.
fn place<T: Real>(memory: *const c_void) -> usize {
    let behind = memory.cast::<u8>().wrapping_add(size_of::<u64>());
    size_of::<u64>() + behind.align_offset(align_of::<LargeChain<T>>())
}

/// Bytes of memory for an estimator `E` behind a mark, wherever the memory begins.
const fn bytes_of<E>() -> usize {
    align_of::<E>() + size_of::<E>()
}

/// Smallest size of estimator for this number of joints and parameters; `None` if there is none.
fn size_of_chain(joints: u32, parameters: u32) -> Option<ChainSize> {
    if joints == 0 || parameters == 0 { None } else { ChainSize::of(joints as usize, parameters as usize) }
}

/// Bytes of an estimator for this number of joints and parameters in the precision of `T`; 0 if there is none.
pub(crate) fn size<T: Real>(joints: u32, parameters: u32) -> usize {
    match size_of_chain(joints, parameters) {
        Some(ChainSize::Small) => bytes_of::<SmallChain<T>>(),
        Some(ChainSize::Medium) => bytes_of::<MediumChain<T>>(),
        Some(ChainSize::Large) => bytes_of::<LargeChain<T>>(),
        None => 0,
    }
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
        usable(memory.cast::<u64>())?;
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
        // SAFETY: not null, aligned, and as large as an estimator of this size with its mark needs.
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
    let place = place::<T>(memory);
    // SAFETY: as promised by the caller; the place is aligned for the estimator.
    unsafe {
        memory.cast::<u64>().write(mark::<T>(size, place));
        memory.byte_add(place).cast::<ChainEstimator<T, N, P, R>>().write(estimator);
    }
    Ok(ARMGAP_OK)
}

/// Size and place of the estimator in the caller's memory by its mark, or the status if there is no estimator.
unsafe fn marked<T: Real>(memory: *const c_void) -> Result<(ChainSize, usize), armgap_status> {
    usable(memory.cast::<u64>())?;
    // SAFETY: the mark is read alone first, from memory that is large enough for it.
    let found = unsafe { memory.cast::<u64>().read() };
    let first = size_of::<u64>();
    for place in (first..=align_of::<LargeChain<T>>()).step_by(first) {
        if let Some(size) = ChainSize::ALL.into_iter().find(|size| mark::<T>(*size, place) == found) {
            return Ok((size, place));
        }
    }
    Err(ARMGAP_NOT_STARTED)
}

/// Result of `read` for the estimator in the caller's memory, or the status if there is none.
unsafe fn opened<T: Real>(
    memory: *const c_void,
    read: impl FnOnce(&dyn OnlineEstimator<T>) -> Result<armgap_status, armgap_status>,
) -> Result<armgap_status, armgap_status> {
    // SAFETY: marked memory was written by `start` with an estimator of the size and at the place that the mark says, or is a copy of such memory.
    unsafe {
        let (size, place) = marked::<T>(memory)?;
        let estimator = memory.byte_add(place);
        match size {
            ChainSize::Small => seen(estimator.cast::<SmallChain<T>>(), |x| read(x)),
            ChainSize::Medium => seen(estimator.cast::<MediumChain<T>>(), |x| read(x)),
            ChainSize::Large => seen(estimator.cast::<LargeChain<T>>(), |x| read(x)),
        }
    }
}

/// Result of `read` for an estimator, or, where it is not aligned because its memory was copied, for a copy.
unsafe fn seen<E: Copy, R>(estimator: *const E, read: impl FnOnce(&E) -> R) -> R {
    // SAFETY: the caller has found the mark of such an estimator.
    unsafe { if estimator.is_aligned() { read(&*estimator) } else { read(&estimator.read_unaligned()) } }
}

/// Estimator in the caller's memory to take a sample, or the status if there is none.
unsafe fn opened_mut<'a, T: Real>(
    memory: *mut c_void,
) -> Result<&'a mut dyn OnlineEstimator<T>, armgap_status> {
    // SAFETY: as above; nobody else holds it during this call.
    unsafe {
        let (size, from) = marked::<T>(memory)?;
        Ok(match size {
            ChainSize::Small => &mut *settled::<T, SmallChain<T>>(memory, size, from),
            ChainSize::Medium => &mut *settled::<T, MediumChain<T>>(memory, size, from),
            ChainSize::Large => &mut *settled::<T, LargeChain<T>>(memory, size, from),
        })
    }
}

/// Pointer to the estimator at the place `from` of the caller's memory; where it is not aligned because its memory was copied, it is moved first.
unsafe fn settled<T: Real, E>(memory: *mut c_void, size: ChainSize, from: usize) -> *mut E {
    let place = place::<T>(memory);
    // SAFETY: the caller has found the mark of such an estimator, and memory has room for it at any of these places.
    unsafe {
        let estimator = memory.byte_add(place).cast::<E>();
        if place != from {
            core::ptr::copy(memory.byte_add(from).cast::<u8>(), estimator.cast::<u8>(), size_of::<E>());
            memory.cast::<u64>().write(mark::<T>(size, place));
        }
        estimator
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
    answer(unsafe { opened::<T>(memory, |estimator| give(estimator.theta(), to, count)) })
}

pub(crate) unsafe fn errors<T: Real>(memory: *const c_void, to: *mut T, count: usize) -> armgap_status {
    answer(unsafe { opened::<T>(memory, |estimator| give(estimator.errors(), to, count)) })
}

pub(crate) unsafe fn variances<T: Real>(memory: *const c_void, to: *mut T, count: usize) -> armgap_status {
    let variances = |estimator: &dyn OnlineEstimator<T>| {
        let mut variances = [T::zero(); MOST];
        let parameters = estimator.variances(&mut variances);
        unsafe { give(variances.get(..parameters).unwrap_or(&variances), to, count) }
    };
    answer(unsafe { opened::<T>(memory, variances) })
}

pub(crate) unsafe fn sigma<T: Real>(memory: *const c_void, to: *mut T, count: usize) -> armgap_status {
    let sigma = |estimator: &dyn OnlineEstimator<T>| {
        let mut sigma = [T::zero(); MOST];
        let parameters = estimator.sigma(&mut sigma);
        unsafe { give(sigma.get(..parameters).unwrap_or(&sigma), to, count) }
    };
    answer(unsafe { opened::<T>(memory, sigma) })
}

pub(crate) unsafe fn report<T: Real>(memory: *const c_void, to: *mut armgap_report) -> armgap_status {
    answer(unsafe { opened::<T>(memory, |estimator| fill_report(estimator, to)) })
}
