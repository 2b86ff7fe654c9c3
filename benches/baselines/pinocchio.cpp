// Pinocchio on the serial arm of the benchmarks: accelerations, joint torque regressors and inverse dynamics over a ring of states.
// Compiled from Pinocchio's headers alone, so that its code is optimized with the same flags as the code beside it.

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include <pinocchio/multibody.hpp>
#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/algorithm/regressor.hpp>
#include <pinocchio/algorithm/rnea.hpp>

namespace {

struct State {
    Eigen::VectorXd q, v, a;
};

struct Arm {
    pinocchio::Model model;
    std::unique_ptr<pinocchio::Data> data;
    std::vector<State> ring;
};

pinocchio::Inertia inertia_of(const double *p) {
    Eigen::Matrix<double, 10, 1> parameters = Eigen::Map<const Eigen::Matrix<double, 10, 1>>(p);
    return pinocchio::Inertia::FromDynamicParameters(parameters);
}

// Keeps the compiler from leaving out a computation whose result is not used.
inline void keep(const void *p) { asm volatile("" : : "g"(p) : "memory"); }

} // namespace

extern "C" {

// Arm of `joints` revolute joints about the z axes of their frames: `placements` has for each joint the rotation into the parent's frame by
// rows (9) and the origin in the parent's frame, m (3); `links` has the ten inertial parameters of each link, SI; `gravity` is in m/s^2.
// `states` has `count` triples of positions, rad, velocities, rad/s, and torques, N m, or accelerations, rad/s^2.
void *pinocchio_arm(std::size_t joints, const double *placements, const double *links, const double *gravity, std::size_t count, const double *states) {
    auto *arm = new Arm;
    pinocchio::JointIndex parent = 0;
    for (std::size_t j = 0; j < joints; ++j) {
        const double *at = placements + 12 * j;
        const Eigen::Matrix3d rotation = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(at);
        const pinocchio::SE3 placement(rotation, Eigen::Vector3d(at[9], at[10], at[11]));
        parent = arm->model.addJoint(parent, pinocchio::JointModelRZ(), placement, "joint" + std::to_string(j));
        arm->model.appendBodyToJoint(parent, inertia_of(links + 10 * j), pinocchio::SE3::Identity());
    }
    arm->model.gravity.linear() = Eigen::Vector3d(gravity[0], gravity[1], gravity[2]);
    arm->data = std::make_unique<pinocchio::Data>(arm->model);
    for (std::size_t i = 0; i < count; ++i) {
        const double *at = states + 3 * joints * i;
        const auto part = [&](std::size_t k) {
            return Eigen::VectorXd(Eigen::Map<const Eigen::VectorXd>(at + k * joints, static_cast<Eigen::Index>(joints)));
        };
        arm->ring.push_back(State{part(0), part(1), part(2)});
    }
    return arm;
}

void pinocchio_arm_free(void *arm) { delete static_cast<Arm *>(arm); }

// Articulated-body algorithm for `passes` states of the ring, one at a time; the accelerations of the last one go to `out`, rad/s^2.
void pinocchio_aba(void *of, int world, std::size_t passes, double *out) {
    auto &arm = *static_cast<Arm *>(of);
    const auto convention = world ? pinocchio::Convention::WORLD : pinocchio::Convention::LOCAL;
    for (std::size_t i = 0; i < passes; ++i) {
        const State &s = arm.ring[i % arm.ring.size()];
        pinocchio::aba(arm.model, *arm.data, s.q, s.v, s.a, convention);
        keep(arm.data->ddq.data());
    }
    Eigen::Map<Eigen::VectorXd>(out, arm.model.nv) = arm.data->ddq;
}

// Joint torque regressor for `passes` states of the ring; that of the last one goes to `out`, `joints` rows of `10 joints` numbers.
void pinocchio_regressor(void *of, std::size_t passes, double *out) {
    auto &arm = *static_cast<Arm *>(of);
    for (std::size_t i = 0; i < passes; ++i) {
        const State &s = arm.ring[i % arm.ring.size()];
        pinocchio::computeJointTorqueRegressor(arm.model, *arm.data, s.q, s.v, s.a);
        keep(arm.data->jointTorqueRegressor.data());
    }
    using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    Eigen::Map<Rows>(out, arm.model.nv, 10 * arm.model.nv) = arm.data->jointTorqueRegressor;
}

// Inverse dynamics for `passes` states of the ring; the torques of the last one go to `out`, N m.
void pinocchio_rnea(void *of, std::size_t passes, double *out) {
    auto &arm = *static_cast<Arm *>(of);
    for (std::size_t i = 0; i < passes; ++i) {
        const State &s = arm.ring[i % arm.ring.size()];
        pinocchio::rnea(arm.model, *arm.data, s.q, s.v, s.a);
        keep(arm.data->tau.data());
    }
    Eigen::Map<Eigen::VectorXd>(out, arm.model.nv) = arm.data->tau;
}

} // extern "C"
