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
 Version of the functions and types of serial arms.
 */
#define ARMGAP_CHAIN_VERSION 2

/*
 What a call answers.
 */
enum armgap_status
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  /*
   Done; an update has moved the estimate.
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
   The caller was compiled with another version of the header.
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
 Kinds of arm.
 */
enum armgap_arm
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  /*
   One linear joint: moving mass, weight along the axis, viscous, Coulomb.
   */
  ARMGAP_AXIS = 0,
  /*
   One rotary joint under gravity: inertia, gravity torque, viscous, Coulomb.
   */
  ARMGAP_PENDULUM = 1,
  /*
   The vertical two-link arm of Reyes and Kelly (1997): theta1 to theta5, viscous 1 and 2, Coulomb 1 and 2.
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
 Regression models.
 */
enum armgap_scheme
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  /*
   Equation (24): filtered torques, one error per joint.
   */
  ARMGAP_FILTERED_DYNAMIC = 0,
  /*
   Equation (28): supplied energy.
   */
  ARMGAP_SUPPLIED_ENERGY = 1,
  /*
   Equation (30): filtered power.
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
 Filters.
 */
enum armgap_filters
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  /*
   Consistent with each other and with held torques.
   */
  ARMGAP_EXACT = 0,
  /*
   As printed in the paper.
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
 How the covariance is kept.
 */
enum armgap_form
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  /*
   Plain in double precision with p0 up to 1e6, factorized otherwise.
   */
  ARMGAP_DEFAULT_FORM = 0,
  /*
   Equation (21) as printed.
   */
  ARMGAP_PLAIN = 1,
  /*
   U D U'.
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
 Kinds of joint.
 */
enum armgap_joint_kind
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  /*
   Turns about its axis: rad, N m.
   */
  ARMGAP_REVOLUTE = 0,
  /*
   Slides along its axis: m, N.
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
 Settings; `armgap_settings_default` fills them.
 */
typedef struct {
  /*
   An `armgap_arm`.
   */
  uint32_t arm;
  /*
   An `armgap_scheme`.
   */
  uint32_t scheme;
  /*
   An `armgap_filters`.
   */
  uint32_t filters;
  /*
   An `armgap_form`.
   */
  uint32_t form;
  /*
   Whether one constant torque per joint is estimated too, after all other parameters: 0 or 1.
   */
  uint32_t asymmetry;
  /*
   Samples used before the alarm begins to learn.
   */
  uint32_t settling;
  /*
   Samples from which the alarm learns the errors' sizes, at least 2.
   */
  uint32_t learning;
  /*
   Not used; 0.
   */
  uint32_t reserved;
  /*
   Cut-off of the filters, rad/s.
   */
  double cutoff;
  /*
   Forgetting factor, above 0 and at most 1.
   */
  double forgetting;
  /*
   Initial covariance, times the unit matrix; forgetting lifts no variance above it.
   */
  double p0;
  /*
   Samples over which spread and excitation are averaged, at least 1.
   */
  double memory;
  /*
   Mean samples between false alarms, at least 10.
   */
  double between;
  /*
   Smallest standard deviation of an error that matters, in the error's unit.
   */
  double floor;
} armgap_settings;

/*
 An estimator in double precision; its contents are nobody's business.
 */
typedef struct {
  /*
   Not to be touched.
   */
  uint64_t opaque[512];
} armgap_estimator;

/*
 What an estimator says about itself.
 */
typedef struct {
  /*
   Samples used.
   */
  uint64_t updates;
  /*
   Samples rejected.
   */
  uint64_t rejected;
  /*
   Near 1 while the motion excites every parameter, near 0 while it teaches nothing new.
   */
  double excitation;
  /*
   Above 1 the model no longer explains the arm.
   */
  double alarm;
  /*
   Parameters that are estimated.
   */
  uint32_t parameters;
  /*
   Prediction errors per sample.
   */
  uint32_t outputs;
} armgap_report;

/*
 An estimator in single precision; its contents are nobody's business.
 */
typedef struct {
  /*
   Not to be touched.
   */
  uint64_t opaque[256];
} armgap_estimator_f32;

/*
 Settings of an estimator of a serial arm; `armgap_chain_settings_default` fills them.
 */
typedef struct {
  /*
   `ARMGAP_CHAIN_VERSION`.
   */
  uint32_t version;
  /*
   Number of joints, 1 to 7.
   */
  uint32_t joints;
  /*
   Number of parameters that are estimated, 1 to 72.
   */
  uint32_t parameters;
  /*
   An `armgap_scheme`.
   */
  uint32_t scheme;
  /*
   An `armgap_filters`.
   */
  uint32_t filters;
  /*
   An `armgap_form`.
   */
  uint32_t form;
  /*
   Samples used before the alarm begins to learn.
   */
  uint32_t settling;
  /*
   Samples from which the alarm learns the errors' sizes, at least 2.
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
   Forgetting factor, above 0 and at most 1.
   */
  double forgetting;
  /*
   Initial covariance, times the unit matrix; forgetting lifts no variance above it.
   */
  double p0;
  /*
   Samples over which spread and excitation are averaged, at least 1.
   */
  double memory;
  /*
   Mean samples between false alarms, at least 10.
   */
  double between;
  /*
   Smallest standard deviation of an error that matters, in the error's unit.
   */
  double floor;
} armgap_chain_settings;

/*
 A joint of a serial arm, in the frame of the link before it, or of the base. The link's frame is the joint's, moved by the joint.
 */
typedef struct {
  /*
   An `armgap_joint_kind`.
   */
  uint32_t kind;
  /*
   Not used; 0.
   */
  uint32_t reserved;
  /*
   Rotation matrix, row by row, from the joint's frame into that of the link before, at position 0.
   */
  double rotation[9];
  /*
   Origin of the joint's frame in that of the link before [m].
   */
  double translation[3];
  /*
   Unit vector along the axis, in the joint's frame.
   */
  double axis[3];
} armgap_joint;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/*
 Fills `settings` with the defaults for an `armgap_arm`: filtered power, exact filters at 50 rad/s, no forgetting.
 */
armgap_status armgap_settings_default(armgap_settings *settings,
                                      uint32_t arm);

/*
 Number of joints of an `armgap_arm`; 0 for no known one.
 */
size_t armgap_joints(uint32_t arm);

/*
 Number of parameters of an `armgap_arm` without asymmetries; 0 for no known one.
 */
size_t armgap_parameters(uint32_t arm);

/*
 One line about an `armgap_status`, never null.
 */
const char *armgap_message(int32_t status);

/*
 Starts an estimator in the caller's memory; `size` is `sizeof(*estimator)`. `theta0` has `count` entries, one per parameter, or is
 optional with `count` 0, which means zeros. Starting again is allowed at any time.
 */
armgap_status armgap_start(armgap_estimator *estimator,
                           size_t size,
                           const armgap_settings *settings,
                           const double *theta0,
                           size_t count);

/*
 Takes one sample at time `t` [s]: positions, optional velocities, and the torques that act until the next sample, each of `joints`
 entries. Whether velocities are given is settled by the first sample.
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
 Copies the estimate; `count` is the number of parameters.
 */
armgap_status armgap_theta(const armgap_estimator *estimator, double *theta, size_t count);

/*
 Copies the standard deviations of the estimate, as if errors were white.
 */
armgap_status armgap_sigma(const armgap_estimator *estimator, double *sigma, size_t count);

/*
 Copies the prediction errors of the last sample that was used; `count` is the number of outputs.
 */
armgap_status armgap_errors(const armgap_estimator *estimator, double *errors, size_t count);

/*
 Fills `report`.
 */
armgap_status armgap_report_of(const armgap_estimator *estimator, armgap_report *report);

/*
 Starts an estimator in the caller's memory; `size` is `sizeof(*estimator)`. `theta0` has `count` entries, one per parameter, or is
 optional with `count` 0, which means zeros. Starting again is allowed at any time.
 */
armgap_status armgap_start_f32(armgap_estimator_f32 *estimator,
                               size_t size,
                               const armgap_settings *settings,
                               const float *theta0,
                               size_t count);

/*
 Takes one sample at time `t` [s]: positions, optional velocities, and the torques that act until the next sample, each of `joints`
 entries. Whether velocities are given is settled by the first sample.
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
 Copies the estimate; `count` is the number of parameters.
 */
armgap_status armgap_theta_f32(const armgap_estimator_f32 *estimator, float *theta, size_t count);

/*
 Copies the standard deviations of the estimate, as if errors were white.
 */
armgap_status armgap_sigma_f32(const armgap_estimator_f32 *estimator, float *sigma, size_t count);

/*
 Copies the prediction errors of the last sample that was used; `count` is the number of outputs.
 */
armgap_status armgap_errors_f32(const armgap_estimator_f32 *estimator, float *errors, size_t count);

/*
 Fills `report`.
 */
armgap_status armgap_report_of_f32(const armgap_estimator_f32 *estimator, armgap_report *report);

/*
 Moves an arm with parameters `theta` of an `armgap_arm` by `h` seconds under held torques; `q` and `dq` are read and written.
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
 Fills `settings` for an arm with so many joints and estimated parameters on a level base: filtered power, exact filters at 50 rad/s, no
 forgetting, gravity of 9.81 against z.
 */
armgap_status armgap_chain_settings_default(armgap_chain_settings *settings,
                                            uint32_t joints,
                                            uint32_t parameters);

/*
 Bytes of memory that an estimator in double precision needs, aligned to 8; 0 if there is none of so many joints and parameters.
 */
size_t armgap_chain_size(uint32_t joints,
                         uint32_t parameters);

/*
 Starts an estimator in `size` bytes of the caller's memory, at least `armgap_chain_size`. `joints` has one entry per joint, `columns` one per
 estimated parameter, strictly ascending: indices from 0 into ten numbers of each link (mass, first moments x, y, z, second moments xx,
 xy, yy, xz, yz, zz about the origin of its frame), then rotor inertias, viscous, Coulomb, and constant torques of all joints. `known`
 holds the values of the first 13 numbers per joint, of which those count that are not estimated; optional, zeros by default. `theta0`
 holds one start value per estimated parameter; optional, zeros by default. Starting again is allowed at any time.
 */
armgap_status armgap_chain_start(void *memory,
                                 size_t size,
                                 const armgap_chain_settings *settings,
                                 const armgap_joint *joints,
                                 const uint32_t *columns,
                                 const double *known,
                                 const double *theta0);

/*
 Takes one sample at time `t` [s]: positions, optional velocities, and the torques that act until the next sample, each of `joints`
 entries. Whether velocities are given is settled by the first sample.
 */
armgap_status armgap_chain_update(void *memory,
                                  double t,
                                  const double *q,
                                  const double *dq,
                                  const double *tau,
                                  size_t joints);

/*
 Takes one sample `h` seconds after the last one. Arguments as for `armgap_chain_update`.
 */
armgap_status armgap_chain_update_after(void *memory,
                                        double h,
                                        const double *q,
                                        const double *dq,
                                        const double *tau,
                                        size_t joints);

/*
 Copies the estimate; `count` is the number of estimated parameters.
 */
armgap_status armgap_chain_theta(const void *memory, double *theta, size_t count);

/*
 Copies the diagonal of the covariance for an error of unit variance.
 */
armgap_status armgap_chain_variances(const void *memory, double *variances, size_t count);

/*
 Copies the standard deviations of the estimate, as if errors were white.
 */
armgap_status armgap_chain_sigma(const void *memory, double *sigma, size_t count);

/*
 Copies the prediction errors of the last sample that was used; `count` is the number of outputs.
 */
armgap_status armgap_chain_errors(const void *memory, double *errors, size_t count);

/*
 Fills `report`.
 */
armgap_status armgap_chain_report_of(const void *memory, armgap_report *report);

/*
 Bytes of memory that an estimator in single precision needs, aligned to 8; 0 if there is none of so many joints and parameters.
 */
size_t armgap_chain_size_f32(uint32_t joints,
                             uint32_t parameters);

/*
 Starts an estimator in `size` bytes of the caller's memory, at least `armgap_chain_size_f32`. `joints` has one entry per joint, `columns` one per
 estimated parameter, strictly ascending: indices from 0 into ten numbers of each link (mass, first moments x, y, z, second moments xx,
 xy, yy, xz, yz, zz about the origin of its frame), then rotor inertias, viscous, Coulomb, and constant torques of all joints. `known`
 holds the values of the first 13 numbers per joint, of which those count that are not estimated; optional, zeros by default. `theta0`
 holds one start value per estimated parameter; optional, zeros by default. Starting again is allowed at any time.
 */
armgap_status armgap_chain_start_f32(void *memory,
                                     size_t size,
                                     const armgap_chain_settings *settings,
                                     const armgap_joint *joints,
                                     const uint32_t *columns,
                                     const double *known,
                                     const float *theta0);

/*
 Takes one sample at time `t` [s]: positions, optional velocities, and the torques that act until the next sample, each of `joints`
 entries. Whether velocities are given is settled by the first sample.
 */
armgap_status armgap_chain_update_f32(void *memory,
                                      float t,
                                      const float *q,
                                      const float *dq,
                                      const float *tau,
                                      size_t joints);

/*
 Takes one sample `h` seconds after the last one. Arguments as for `armgap_chain_update_f32`.
 */
armgap_status armgap_chain_update_after_f32(void *memory,
                                            float h,
                                            const float *q,
                                            const float *dq,
                                            const float *tau,
                                            size_t joints);

/*
 Copies the estimate; `count` is the number of estimated parameters.
 */
armgap_status armgap_chain_theta_f32(const void *memory, float *theta, size_t count);

/*
 Copies the diagonal of the covariance for an error of unit variance.
 */
armgap_status armgap_chain_variances_f32(const void *memory, float *variances, size_t count);

/*
 Copies the standard deviations of the estimate, as if errors were white.
 */
armgap_status armgap_chain_sigma_f32(const void *memory, float *sigma, size_t count);

/*
 Copies the prediction errors of the last sample that was used; `count` is the number of outputs.
 */
armgap_status armgap_chain_errors_f32(const void *memory, float *errors, size_t count);

/*
 Fills `report`.
 */
armgap_status armgap_chain_report_of_f32(const void *memory, armgap_report *report);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* ARMGAP_H */
