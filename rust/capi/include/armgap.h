/*
 * armgap: identification of a robot arm's parameters inside its controller.
 *
 * An estimator lives in memory of the caller's: a variable of type armgap_estimator (double precision) or armgap_estimator_f32, or for
 * a serial arm of one to seven joints (armgap_chain_...) as many bytes as armgap_chain_size says, aligned to 8. No function allocates, locks, prints, or keeps anything of its own, so different estimators may run in different threads. Functions
 * return ARMGAP_OK (0) or another armgap_status; a failed call has changed nothing. Vectors are arrays in SI units with their
 * lengths beside them; any pointer that a function does not call optional must not be null.
 *
 * Written by cbindgen: change rust/capi/src and run `make header`.
 */

#ifndef ARMGAP_H
#define ARMGAP_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/*
 Version of the C functions and types of serial arms.
 */
#define ARMGAP_CHAIN_VERSION 2

/*
 Status that a function of the C interface returns.
 */
enum armgap_status
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  /*
   The call succeeded; an update has moved the estimate.
   */
  ARMGAP_OK = 0,
  /*
   The sample was taken; there are not enough samples for an estimate yet.
   */
  ARMGAP_STARTING = 1,
  /*
   The sample was not used: not finite, of impossible size, or not later than the last one. The estimate has not changed.
   */
  ARMGAP_REJECTED = 2,
  /*
   A pointer is null.
   */
  ARMGAP_NULL = -1,
  /*
   A pointer is not aligned for its type.
   */
  ARMGAP_UNALIGNED = -2,
  /*
   An array has another length than the arm needs.
   */
  ARMGAP_LENGTH = -3,
  /*
   A setting or a number is not finite or outside its range.
   */
  ARMGAP_RANGE = -4,
  /*
   The estimator was never started, or its memory was overwritten.
   */
  ARMGAP_NOT_STARTED = -5,
  /*
   The caller was compiled with another version of armgap.h.
   */
  ARMGAP_VERSION = -6,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum armgap_status armgap_status;
#else
typedef int32_t armgap_status;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/*
 Kind of arm with dynamics in closed form, with the order of its parameters.
 */
enum armgap_arm
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  /*
   One linear joint; parameters: moving mass, weight along the axis, viscous, Coulomb.
   */
  ARMGAP_AXIS = 0,
  /*
   One rotary joint under gravity; parameters: inertia, largest gravity torque, viscous, Coulomb.
   */
  ARMGAP_PENDULUM = 1,
  /*
   The vertical two-link arm of Reyes and Kelly (1997); parameters: theta1 to theta5, viscous 1 and 2, Coulomb 1 and 2.
   */
  ARMGAP_TWO_LINK = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum armgap_arm armgap_arm;
#else
typedef uint32_t armgap_arm;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/*
 Regression model of an estimator, after Reyes and Kelly (1997).
 */
enum armgap_scheme
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  /*
   Filtered dynamic model, Reyes and Kelly (1997), equation (24): one prediction error per joint [N m or N].
   */
  ARMGAP_FILTERED_DYNAMIC = 0,
  /*
   Supplied energy model, Reyes and Kelly (1997), equation (28): one prediction error [J].
   */
  ARMGAP_SUPPLIED_ENERGY = 1,
  /*
   Filtered power model, Reyes and Kelly (1997), equation (30): one prediction error [W].
   */
  ARMGAP_FILTERED_POWER = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum armgap_scheme armgap_scheme;
#else
typedef uint32_t armgap_scheme;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/*
 Filters of an estimator.
 */
enum armgap_filters
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  /*
   Filters consistent with each other and with held torques.
   */
  ARMGAP_EXACT = 0,
  /*
   Filters as printed by Reyes and Kelly (1997).
   */
  ARMGAP_PAPER = 1,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum armgap_filters armgap_filters;
#else
typedef uint32_t armgap_filters;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/*
 Form in which an estimator keeps its covariance.
 */
enum armgap_form
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  /*
   Full matrix in double precision with p0 up to 1e6, factors U D U' otherwise.
   */
  ARMGAP_DEFAULT_FORM = 0,
  /*
   Full matrix, updated by equation (21) of Reyes and Kelly (1997) as printed.
   */
  ARMGAP_PLAIN = 1,
  /*
   Factors U D U' of the covariance, positive definite whatever the rounding.
   */
  ARMGAP_FACTORIZED = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum armgap_form armgap_form;
#else
typedef uint32_t armgap_form;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/*
 Kind of a joint: revolute or prismatic.
 */
enum armgap_joint_kind
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  /*
   The joint turns about its axis: rad, N m.
   */
  ARMGAP_REVOLUTE = 0,
  /*
   The joint slides along its axis: m, N.
   */
  ARMGAP_PRISMATIC = 1,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum armgap_joint_kind armgap_joint_kind;
#else
typedef uint32_t armgap_joint_kind;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/*
 Settings of an online estimator; `armgap_settings_default` fills them.
 */
typedef struct {
  /*
   Kind of arm, an `armgap_arm`.
   */
  uint32_t arm;
  /*
   Regression model, an `armgap_scheme`.
   */
  uint32_t scheme;
  /*
   Filters, an `armgap_filters`.
   */
  uint32_t filters;
  /*
   Form in which the covariance is kept, an `armgap_form`.
   */
  uint32_t form;
  /*
   Whether one constant torque per joint is estimated after all other parameters: 0 or 1.
   */
  uint32_t asymmetry;
  /*
   Number of samples used before the alarm begins to learn.
   */
  uint32_t settling;
  /*
   Number of samples from which the alarm learns the sizes of the prediction errors, at least 2.
   */
  uint32_t learning;
  /*
   Unused field, must be 0.
   */
  uint32_t reserved;
  /*
   Cut-off of the filters, rad/s.
   */
  double cutoff;
  /*
   Forgetting factor of recursive least squares, above 0 and at most 1.
   */
  double forgetting;
  /*
   Initial variance of every parameter, at an error of unit variance; forgetting lifts no variance above it.
   */
  double p0;
  /*
   Number of samples over which mean square error and excitation are averaged, at least 1.
   */
  double memory;
  /*
   Mean number of samples between false alarms, at least 10.
   */
  double between;
  /*
   Smallest standard deviation of a prediction error that matters, in the unit of the error.
   */
  double floor;
} armgap_settings;

/*
 Online estimator in double precision; opaque memory of the caller.
 */
typedef struct {
  /*
   Opaque contents of the estimator, not to be read or written.
   */
  uint64_t opaque[512];
} armgap_estimator;

/*
 Counts of samples, excitation and alarm of an estimator.
 */
typedef struct {
  /*
   Number of samples used.
   */
  uint64_t updates;
  /*
   Number of samples rejected.
   */
  uint64_t rejected;
  /*
   Excitation: near 1 while the motion excites every parameter, near 0 while it teaches nothing new.
   */
  double excitation;
  /*
   Alarm level: above 1 the model no longer explains the arm.
   */
  double alarm;
  /*
   Number of estimated parameters.
   */
  uint32_t parameters;
  /*
   Number of prediction errors per sample.
   */
  uint32_t outputs;
} armgap_report;

/*
 Online estimator in single precision; opaque memory of the caller.
 */
typedef struct {
  /*
   Opaque contents of the estimator, not to be read or written.
   */
  uint64_t opaque[256];
} armgap_estimator_f32;

/*
 Settings of an online estimator of a serial arm; `armgap_chain_settings_default` fills them.
 */
typedef struct {
  /*
   Version of the interface, `ARMGAP_CHAIN_VERSION`.
   */
  uint32_t version;
  /*
   Number of joints of the arm, 1 to 7.
   */
  uint32_t joints;
  /*
   Number of estimated parameters, 1 to 72.
   */
  uint32_t parameters;
  /*
   Regression model, an `armgap_scheme`.
   */
  uint32_t scheme;
  /*
   Filters, an `armgap_filters`.
   */
  uint32_t filters;
  /*
   Form in which the covariance is kept, an `armgap_form`.
   */
  uint32_t form;
  /*
   Number of samples used before the alarm begins to learn.
   */
  uint32_t settling;
  /*
   Number of samples from which the alarm learns the sizes of the prediction errors, at least 2.
   */
  uint32_t learning;
  /*
   Acceleration of gravity in the frame of the base [m/s^2].
   */
  double gravity[3];
  /*
   Cut-off of the filters, rad/s.
   */
  double cutoff;
  /*
   Forgetting factor of recursive least squares, above 0 and at most 1.
   */
  double forgetting;
  /*
   Initial variance of every parameter, at an error of unit variance; forgetting lifts no variance above it.
   */
  double p0;
  /*
   Number of samples over which mean square error and excitation are averaged, at least 1.
   */
  double memory;
  /*
   Mean number of samples between false alarms, at least 10.
   */
  double between;
  /*
   Smallest standard deviation of a prediction error that matters, in the unit of the error.
   */
  double floor;
} armgap_chain_settings;

/*
 Joint of a serial arm, in the frame of the previous link, or of the base. At position 0 the link's frame is the joint's frame.
 */
typedef struct {
  /*
   Kind of the joint, an `armgap_joint_kind`.
   */
  uint32_t kind;
  /*
   Unused field, must be 0.
   */
  uint32_t reserved;
  /*
   Rotation matrix, row by row, from the joint's frame into the frame of the previous link, at position 0.
   */
  double rotation[9];
  /*
   Origin of the joint's frame in the frame of the previous link [m].
   */
  double translation[3];
  /*
   Unit vector along the joint's axis, in the joint's frame.
   */
  double axis[3];
} armgap_joint;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/*
 Fills `settings` with the defaults for an `armgap_arm`: filtered power model, exact filters at 50 rad/s, no forgetting.
 */
armgap_status armgap_settings_default(armgap_settings *settings,
                                      uint32_t arm);

/*
 Number of joints of an `armgap_arm`; 0 if `arm` is not one.
 */
size_t armgap_joints(uint32_t arm);

/*
 Number of parameters of an `armgap_arm` without constant torques; 0 if `arm` is not one.
 */
size_t armgap_parameters(uint32_t arm);

/*
 Message of one line for an `armgap_status`, never null.
 */
const char *armgap_message(int32_t status);

/*
 Starts an estimator in the caller's memory; `size` is `sizeof(*estimator)`. `theta0` has `count` start values, SI, one per parameter, or is
 optional with `count` 0, which means zeros. Starting again is allowed at any time.
 */
armgap_status armgap_start(armgap_estimator *estimator,
                           size_t size,
                           const armgap_settings *settings,
                           const double *theta0,
                           size_t count);

/*
 Takes one sample at time `t` [s]: positions, optional velocities, and the torques that act until the next sample, SI, each of `joints` entries.
 Whether velocities are given is settled by the first sample.
 */
armgap_status armgap_update(armgap_estimator *estimator,
                            double t,
                            const double *q,
                            const double *dq,
                            const double *tau,
                            size_t joints);

/*
 Takes one sample `h` seconds after the last one; `h` keeps its resolution however long the controller runs. Arguments as for
 `armgap_update`.
 */
armgap_status armgap_update_after(armgap_estimator *estimator,
                                  double h,
                                  const double *q,
                                  const double *dq,
                                  const double *tau,
                                  size_t joints);

/*
 Copies the estimated parameters, SI; `count` is their number.
 */
armgap_status armgap_theta(const armgap_estimator *estimator, double *theta, size_t count);

/*
 Copies the `count` standard deviations of the estimated parameters, SI, as if prediction errors were white.
 */
armgap_status armgap_sigma(const armgap_estimator *estimator,
                           double *sigma,
                           size_t count);

/*
 Copies the prediction errors of the last sample that was used, N m, J or W by scheme; `count` is `outputs` of the report.
 */
armgap_status armgap_errors(const armgap_estimator *estimator,
                            double *errors,
                            size_t count);

/*
 Fills `report` with counts of samples, excitation and alarm of an estimator.
 */
armgap_status armgap_report_of(const armgap_estimator *estimator, armgap_report *report);

/*
 Starts an estimator in the caller's memory; `size` is `sizeof(*estimator)`. `theta0` has `count` start values, SI, one per parameter, or is
 optional with `count` 0, which means zeros. Starting again is allowed at any time.
 */
armgap_status armgap_start_f32(armgap_estimator_f32 *estimator,
                               size_t size,
                               const armgap_settings *settings,
                               const float *theta0,
                               size_t count);

/*
 Takes one sample at time `t` [s]: positions, optional velocities, and the torques that act until the next sample, SI, each of `joints` entries.
 Whether velocities are given is settled by the first sample.
 */
armgap_status armgap_update_f32(armgap_estimator_f32 *estimator,
                                float t,
                                const float *q,
                                const float *dq,
                                const float *tau,
                                size_t joints);

/*
 Takes one sample `h` seconds after the last one; `h` keeps its resolution however long the controller runs. Arguments as for
 `armgap_update_f32`.
 */
armgap_status armgap_update_after_f32(armgap_estimator_f32 *estimator,
                                      float h,
                                      const float *q,
                                      const float *dq,
                                      const float *tau,
                                      size_t joints);

/*
 Copies the estimated parameters, SI; `count` is their number.
 */
armgap_status armgap_theta_f32(const armgap_estimator_f32 *estimator, float *theta, size_t count);

/*
 Copies the `count` standard deviations of the estimated parameters, SI, as if prediction errors were white.
 */
armgap_status armgap_sigma_f32(const armgap_estimator_f32 *estimator,
                               float *sigma,
                               size_t count);

/*
 Copies the prediction errors of the last sample that was used, N m, J or W by scheme; `count` is `outputs` of the report.
 */
armgap_status armgap_errors_f32(const armgap_estimator_f32 *estimator,
                                float *errors,
                                size_t count);

/*
 Fills `report` with counts of samples, excitation and alarm of an estimator.
 */
armgap_status armgap_report_of_f32(const armgap_estimator_f32 *estimator, armgap_report *report);

/*
 Moves an `armgap_arm` with the parameters `theta` by `h` seconds under held torques `tau`, SI; positions `q` and velocities `dq` are read and
 written.
 */
armgap_status armgap_advance(uint32_t arm,
                             const double *theta,
                             size_t parameters,
                             double h,
                             double *q,
                             double *dq,
                             const double *tau,
                             size_t joints);

/*
 Fills `settings` for an arm with this number of joints and estimated parameters on a level base: filtered power model, exact filters at 50 rad/s,
 no forgetting, gravity of 9.81 m/s^2 against z.
 */
armgap_status armgap_chain_settings_default(armgap_chain_settings *settings,
                                            uint32_t joints,
                                            uint32_t parameters);

/*
 Bytes of memory, aligned to 8, of an estimator of a serial arm in double precision; 0 if there is none for this number of joints and parameters.
 */
size_t armgap_chain_size(uint32_t joints,
                         uint32_t parameters);

/*
 Starts an estimator of a serial arm in `size` bytes of the caller's memory, at least `armgap_chain_size`. `joints` has one entry per joint,
 `columns` one per estimated parameter, strictly ascending: indices from 0 into ten numbers of each link (mass, first moments x, y, z, second
 moments xx, xy, yy, xz, yz, zz about the origin of the link's frame), then rotor inertias, viscous, Coulomb, and constant torques of all joints.
 `known` holds values of the first 13 numbers per joint, SI, used for those that are not estimated; optional, zeros by default. `theta0` holds one
 start value per estimated parameter; optional, zeros by default. Starting again is allowed at any time.
 */
armgap_status armgap_chain_start(void *memory,
                                 size_t size,
                                 const armgap_chain_settings *settings,
                                 const armgap_joint *joints,
                                 const uint32_t *columns,
                                 const double *known,
                                 const double *theta0);

/*
 Takes one sample of a serial arm at time `t` [s]: positions, optional velocities, and the torques that act until the next sample, SI, each of
 `joints` entries. Whether velocities are given is settled by the first sample.
 */
armgap_status armgap_chain_update(void *memory,
                                  double t,
                                  const double *q,
                                  const double *dq,
                                  const double *tau,
                                  size_t joints);

/*
 Takes one sample of a serial arm `h` seconds after the last one. Arguments as for `armgap_chain_update`.
 */
armgap_status armgap_chain_update_after(void *memory,
                                        double h,
                                        const double *q,
                                        const double *dq,
                                        const double *tau,
                                        size_t joints);

/*
 Copies the estimated parameters of a serial arm, SI; `count` is their number.
 */
armgap_status armgap_chain_theta(const void *memory, double *theta, size_t count);

/*
 Copies the `count` diagonal entries of the covariance of the estimate, for a prediction error of unit variance.
 */
armgap_status armgap_chain_variances(const void *memory,
                                     double *variances,
                                     size_t count);

/*
 Copies the `count` standard deviations of the estimated parameters, SI, as if prediction errors were white.
 */
armgap_status armgap_chain_sigma(const void *memory,
                                 double *sigma,
                                 size_t count);

/*
 Copies the prediction errors of the last sample that was used, N m, J or W by scheme; `count` is `outputs` of the report.
 */
armgap_status armgap_chain_errors(const void *memory,
                                  double *errors,
                                  size_t count);

/*
 Fills `report` with counts of samples, excitation and alarm of an estimator of a serial arm.
 */
armgap_status armgap_chain_report_of(const void *memory, armgap_report *report);

/*
 Bytes of memory, aligned to 8, of an estimator of a serial arm in single precision; 0 if there is none for this number of joints and parameters.
 */
size_t armgap_chain_size_f32(uint32_t joints,
                             uint32_t parameters);

/*
 Starts an estimator of a serial arm in `size` bytes of the caller's memory, at least `armgap_chain_size_f32`. `joints` has one entry per joint,
 `columns` one per estimated parameter, strictly ascending: indices from 0 into ten numbers of each link (mass, first moments x, y, z, second
 moments xx, xy, yy, xz, yz, zz about the origin of the link's frame), then rotor inertias, viscous, Coulomb, and constant torques of all joints.
 `known` holds values of the first 13 numbers per joint, SI, used for those that are not estimated; optional, zeros by default. `theta0` holds one
 start value per estimated parameter; optional, zeros by default. Starting again is allowed at any time.
 */
armgap_status armgap_chain_start_f32(void *memory,
                                     size_t size,
                                     const armgap_chain_settings *settings,
                                     const armgap_joint *joints,
                                     const uint32_t *columns,
                                     const double *known,
                                     const float *theta0);

/*
 Takes one sample of a serial arm at time `t` [s]: positions, optional velocities, and the torques that act until the next sample, SI, each of
 `joints` entries. Whether velocities are given is settled by the first sample.
 */
armgap_status armgap_chain_update_f32(void *memory,
                                      float t,
                                      const float *q,
                                      const float *dq,
                                      const float *tau,
                                      size_t joints);

/*
 Takes one sample of a serial arm `h` seconds after the last one. Arguments as for `armgap_chain_update_f32`.
 */
armgap_status armgap_chain_update_after_f32(void *memory,
                                            float h,
                                            const float *q,
                                            const float *dq,
                                            const float *tau,
                                            size_t joints);

/*
 Copies the estimated parameters of a serial arm, SI; `count` is their number.
 */
armgap_status armgap_chain_theta_f32(const void *memory, float *theta, size_t count);

/*
 Copies the `count` diagonal entries of the covariance of the estimate, for a prediction error of unit variance.
 */
armgap_status armgap_chain_variances_f32(const void *memory,
                                         float *variances,
                                         size_t count);

/*
 Copies the `count` standard deviations of the estimated parameters, SI, as if prediction errors were white.
 */
armgap_status armgap_chain_sigma_f32(const void *memory,
                                     float *sigma,
                                     size_t count);

/*
 Copies the prediction errors of the last sample that was used, N m, J or W by scheme; `count` is `outputs` of the report.
 */
armgap_status armgap_chain_errors_f32(const void *memory,
                                      float *errors,
                                      size_t count);

/*
 Fills `report` with counts of samples, excitation and alarm of an estimator of a serial arm.
 */
armgap_status armgap_chain_report_of_f32(const void *memory, armgap_report *report);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* ARMGAP_H */
