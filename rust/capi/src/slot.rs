//! Estimator of an arm of one or two joints in the caller's memory.

use crate::settings::{armgap_report, armgap_settings, armgap_status, status_of};
use armgap_core::online::{MOST_JOINTS, MOST_PARAMETERS, Online, OnlineEstimator, SampleStatus, When};
use armgap_core::real::Real;
use armgap_status::{
    ARMGAP_LENGTH, ARMGAP_NOT_STARTED, ARMGAP_NULL, ARMGAP_OK, ARMGAP_RANGE, ARMGAP_REJECTED,
    ARMGAP_STARTING, ARMGAP_UNALIGNED, ARMGAP_VERSION,
};

/// First word of memory that holds an estimator of this version, before size and precision are mixed in.
const MARK: u64 = 0x4d47_5241_0001_0000;

/// Contents of the caller's memory: a mark and an estimator.
#[repr(C)]
pub(crate) struct Slot<T: Real> {
    mark: u64,
    online: Online<T>,
}

impl<T: Real> Slot<T> {
    const MARKED: u64 = MARK ^ ((size_of::<Self>() as u64) << 1) ^ (size_of::<T>() as u64);
}

/// Error if a pointer is null or not aligned for `T`.
pub(crate) fn usable<T>(pointer: *const T) -> Result<(), armgap_status> {
    if pointer.is_null() {
        Err(ARMGAP_NULL)
    } else if !pointer.is_aligned() {
        Err(ARMGAP_UNALIGNED)
    } else {
        Ok(())
    }
}

/// The caller's array of `count` numbers as a slice; error if `count` is larger than `most`.
pub(crate) unsafe fn slice<'a, T>(
    pointer: *const T,
    count: usize,
    most: usize,
) -> Result<&'a [T], armgap_status> {
    usable(pointer)?;
    if count > most {
        return Err(ARMGAP_LENGTH);
    }
    // SAFETY: not null, aligned, and small; that it holds `count` numbers is the caller's promise.
    Ok(unsafe { core::slice::from_raw_parts(pointer, count) })
}

pub(crate) fn answer(done: Result<armgap_status, armgap_status>) -> armgap_status {
    match done {
        Ok(status) | Err(status) => status,
    }
}

pub(crate) unsafe fn start<T: Real, M>(
    memory: *mut M,
    size: usize,
    settings: *const armgap_settings,
    theta0: *const T,
    count: usize,
) -> armgap_status {
    const {
        assert!(size_of::<M>() >= size_of::<Slot<T>>(), "the opaque type is too small");
        assert!(align_of::<M>() >= align_of::<Slot<T>>(), "the opaque type is aligned too little");
    }
    answer((|| {
        usable(memory)?;
        usable(settings)?;
        if size != size_of::<M>() {
            return Err(ARMGAP_VERSION);
        }
        let theta0 = if theta0.is_null() && count == 0 {
            &[]
        } else {
            unsafe { slice(theta0, count, MOST_PARAMETERS)? }
        };
        // SAFETY: checked above.
        let online_settings = unsafe { &*settings }.online_settings::<T>().ok_or(ARMGAP_RANGE)?;
        let online = Online::new(online_settings, theta0).map_err(status_of)?;
        // SAFETY: not null, aligned, large enough by the assertion.
        unsafe { memory.cast::<Slot<T>>().write(Slot { mark: Slot::<T>::MARKED, online }) };
        Ok(ARMGAP_OK)
    })())
}

/// Estimator in the caller's memory, or the status if there is none.
unsafe fn opened<'a, T: Real, M>(memory: *const M) -> Result<&'a Slot<T>, armgap_status> {
    usable(memory)?;
    let slot = memory.cast::<Slot<T>>();
    // SAFETY: the mark is read alone first, from memory that is large enough for it.
    if unsafe { (&raw const (*slot).mark).read() } != Slot::<T>::MARKED {
        return Err(ARMGAP_NOT_STARTED);
    }
    // SAFETY: marked memory was written by `start`.
    Ok(unsafe { &*slot })
}

pub(crate) unsafe fn update<T: Real, M>(
    memory: *mut M,
    when: When<T>,
    q: *const T,
    dq: *const T,
    tau: *const T,
    joints: usize,
) -> armgap_status {
    answer((|| {
        unsafe { opened::<T, M>(memory)? };
        let (q, tau) = unsafe { (slice(q, joints, MOST_JOINTS)?, slice(tau, joints, MOST_JOINTS)?) };
        let dq = if dq.is_null() { None } else { Some(unsafe { slice(dq, joints, MOST_JOINTS)? }) };
        // SAFETY: opened above; nobody else holds it during this call.
        let online = unsafe { &mut (*memory.cast::<Slot<T>>()).online };
        online.update(when, q, dq, tau).map(outcome).map_err(status_of)
    })())
}

/// Status code for what the estimator did with a sample.
pub(crate) fn outcome(status: SampleStatus) -> armgap_status {
    match status {
        SampleStatus::Updated => ARMGAP_OK,
        SampleStatus::Starting => ARMGAP_STARTING,
        SampleStatus::Rejected => ARMGAP_REJECTED,
    }
}

/// Copies the estimator's numbers `from` into the caller's array `to` of length `count`; error unless the lengths are equal.
pub(crate) unsafe fn give<T: Real>(
    from: &[T],
    to: *mut T,
    count: usize,
) -> Result<armgap_status, armgap_status> {
    usable(to.cast_const())?;
    if count != from.len() {
        return Err(ARMGAP_LENGTH);
    }
    for (i, x) in from.iter().enumerate() {
        // SAFETY: not null, aligned; room for `count` numbers is the caller's promise.
        unsafe { to.add(i).write(*x) };
    }
    Ok(ARMGAP_OK)
}

pub(crate) unsafe fn theta<T: Real, M>(memory: *const M, to: *mut T, count: usize) -> armgap_status {
    answer((|| unsafe { give(opened::<T, M>(memory)?.online.theta(), to, count) })())
}

pub(crate) unsafe fn errors<T: Real, M>(memory: *const M, to: *mut T, count: usize) -> armgap_status {
    answer((|| unsafe { give(opened::<T, M>(memory)?.online.errors(), to, count) })())
}

pub(crate) unsafe fn sigma<T: Real, M>(memory: *const M, to: *mut T, count: usize) -> armgap_status {
    answer((|| {
        let mut sigma = [T::zero(); MOST_PARAMETERS];
        let parameters = unsafe { opened::<T, M>(memory)? }.online.sigma(&mut sigma);
        unsafe { give(sigma.get(..parameters).unwrap_or(&sigma), to, count) }
    })())
}

pub(crate) unsafe fn report<T: Real, M>(memory: *const M, to: *mut armgap_report) -> armgap_status {
    answer((|| unsafe { fill_report(opened::<T, M>(memory)?.online.estimator(), to) })())
}

/// Fills a report with counts of samples, excitation and alarm of the estimator.
pub(crate) unsafe fn fill_report<T: Real>(
    estimator: &dyn OnlineEstimator<T>,
    to: *mut armgap_report,
) -> Result<armgap_status, armgap_status> {
    usable(to.cast_const())?;
    let double = |x: T| x.to_subset().unwrap_or(f64::NAN);
    let report = armgap_report {
        updates: estimator.updates(),
        rejected: estimator.rejected(),
        excitation: double(estimator.excitation()),
        alarm: double(estimator.alarm_level()),
        parameters: u32::try_from(estimator.theta().len()).unwrap_or(0),
        outputs: u32::try_from(estimator.errors().len()).unwrap_or(0),
    };
    // SAFETY: not null, aligned.
    unsafe { to.write(report) };
    Ok(ARMGAP_OK)
}
