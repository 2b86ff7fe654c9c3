/* State of the plain C estimator of serial arms; see online_chain.c. */
#ifndef BASELINE_ONLINE_CHAIN_H
#define BASELINE_ONLINE_CHAIN_H

#define JOINTS 7
#define ROOM 72

struct chain_joint {
	double rotation[3][3], translation[3], axis[3];
};

/* Rotation from a link's frame into that of its parent: fixed + cosine cos q + sine sin q. */
struct chain_turn {
	double fixed[3][3], cosine[3][3], sine[3][3];
};

struct chain_state {
	double q[JOINTS], dq[JOINTS];
	/* Columns in use: momentum and the rest of each joint, or the energy. */
	double momentum[JOINTS][ROOM], rest[JOINTS][ROOM], energy[ROOM];
};

struct chain_baseline {
	double theta[ROOM];
	double P[ROOM][ROOM];
	struct chain_joint joints[JOINTS];
	struct chain_turn turns[JOINTS];
	double gravity[3], height[JOINTS], turned_gravity[JOINTS][3];
	int r, columns[ROOM], power;
	long samples;
	double h, lambda, decay, first, last, bulge, half_decay, half_first, half_last;
	double q[JOINTS], tau[JOINTS], tau_before[JOINTS];
	/* The last state and the one before, in turn; state[samples % 2] is the next to be written. */
	struct chain_state state[2];
	double low_momentum[JOINTS][ROOM], low_rest[JOINTS][ROOM], low_energy[ROOM];
	double viscous[JOINTS], coulomb[JOINTS], torque[JOINTS], supply;
};

void chain_start(struct chain_baseline *p, int power, const double *joints, const double *gravity, const int *columns, int r, double h,
                 double cutoff, double p0);
void chain_run(struct chain_baseline *p, const double *q, const double *tau, long samples);
long chain_size(void);

#endif
