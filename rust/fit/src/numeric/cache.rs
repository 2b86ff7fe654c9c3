//! Cache of the last results of a computation by its arguments.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

/// Number of results that a cache holds; the oldest makes room for a new one.
const KEPT: usize = 16;

/// Cache of the last results by their arguments, which threads share.
#[derive(Debug)]
pub struct Cache<K, V>(Mutex<VecDeque<(K, Arc<V>)>>);

impl<K, V> Default for Cache<K, V> {
    fn default() -> Self {
        Self(Mutex::new(VecDeque::with_capacity(KEPT)))
    }
}

impl<K: PartialEq + Clone, V> Cache<K, V> {
    /// The result for the arguments `at`: the cached one, or that of `compute`.
    pub fn of(&self, at: &K, compute: impl FnOnce() -> V) -> Arc<V> {
        let kept = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, result)) = kept().iter().find(|(key, _)| key == at) {
            return Arc::clone(result);
        }
        let result = Arc::new(compute());
        let mut all = kept();
        // Another thread may have computed the same meanwhile.
        if let Some((_, known)) = all.iter().find(|(key, _)| key == at) {
            return Arc::clone(known);
        }
        if all.len() == KEPT {
            all.pop_front();
        }
        all.push_back((at.clone(), Arc::clone(&result)));
        result
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_known_result_is_not_computed_again() {
        let cache = Cache::default();
        assert_eq!(*cache.of(&1, || 10), 10);
        assert_eq!(*cache.of(&1, || 11), 10);
        assert_eq!(*cache.of(&2, || 20), 20);
    }

    #[test]
    fn the_oldest_result_makes_room() {
        let cache = Cache::default();
        for key in 0..=KEPT {
            cache.of(&key, || 0);
        }
        assert_eq!(*cache.of(&0, || 1), 1);
        assert_eq!(*cache.of(&KEPT, || 1), 0);
    }
}
