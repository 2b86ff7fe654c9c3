/* State of the plain C estimator; see online.c. */
#ifndef BASELINE_ONLINE_H
#define BASELINE_ONLINE_H

#define BASELINE_PARAMETERS 9

enum baseline_scheme { BASELINE_DYNAMIC, BASELINE_ENERGY, BASELINE_POWER };

struct baseline_step {
	double decay, first, last, bulge, lambda;
};

struct baseline {
	double theta[BASELINE_PARAMETERS];
	double P[BASELINE_PARAMETERS][BASELINE_PARAMETERS];
	enum baseline_scheme scheme;
	int exact;
	long samples;
	double h, forgetting;
	struct baseline_step whole, half;
	double q[2], tau[2], tau_before[2], state_q[2], last_dq[2];
	double derivative[2][BASELINE_PARAMETERS], derivative_in[2][BASELINE_PARAMETERS];
	double rest[2][BASELINE_PARAMETERS], rest_in[2][BASELINE_PARAMETERS], potential[2][BASELINE_PARAMETERS];
	double viscous[2], coulomb[2];
	double supply[2], supply_in[2];
};

void baseline_start(struct baseline *p, enum baseline_scheme scheme, int exact, double h, double cutoff, double p0, double forgetting);
void baseline_update(struct baseline *p, const double q[2], const double tau[2]);
long baseline_size(void);
/* Many samples in one call, so that no call into another language is counted. */
void baseline_run(struct baseline *p, const double *q, const double *tau, long samples);

#endif
