/* State of the plain C estimator; see online.c. */
#ifndef BASELINE_ONLINE_H
#define BASELINE_ONLINE_H

#define BASELINE_PARAMETERS 9

enum baseline_scheme { BASELINE_DYNAMIC, BASELINE_ENERGY, BASELINE_POWER };

struct baseline_step {
	double decay, held, first, last, bulge, lambda;
};

struct baseline {
	double theta[BASELINE_PARAMETERS];
	double P[BASELINE_PARAMETERS][BASELINE_PARAMETERS];
	enum baseline_scheme scheme;
	int exact;
	long samples;
	double h, inverse, third, forgetting;
	struct baseline_step whole, half;
	double q[2], tau[2], tau_before[2], state_q[2], last_dq[2];
	/* Momentum or energies, filtered, and as they came in last. */
	double inertial[5], inertial_in[5];
	/* The rest and friction alike. */
	double rest[7], rest_in[7];
	double supply[2], supply_in[2];
};

void baseline_start(struct baseline *p, enum baseline_scheme scheme, int exact, double h, double cutoff, double p0, double forgetting);
void baseline_update(struct baseline *p, const double q[2], const double tau[2]);
long baseline_size(void);
/* Many samples in one call, so that no call into another language is counted. */
void baseline_run(struct baseline *p, const double *q, const double *tau, long samples);

#endif
