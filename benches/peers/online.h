/* State of the plain C estimator; see online.c. */
#ifndef PEER_ONLINE_H
#define PEER_ONLINE_H

#define PEER_PARAMETERS 9

enum peer_scheme { PEER_DYNAMIC, PEER_ENERGY, PEER_POWER };

struct peer_step {
	double decay, first, last, bulge, lambda;
};

struct peer {
	double theta[PEER_PARAMETERS];
	double P[PEER_PARAMETERS][PEER_PARAMETERS];
	enum peer_scheme scheme;
	int exact;
	long samples;
	double h, forgetting;
	struct peer_step whole, half;
	double q[2], tau[2], tau_before[2], state_q[2], last_dq[2];
	double derivative[2][PEER_PARAMETERS], derivative_in[2][PEER_PARAMETERS];
	double rest[2][PEER_PARAMETERS], rest_in[2][PEER_PARAMETERS], potential[2][PEER_PARAMETERS];
	double viscous[2], coulomb[2];
	double supply[2], supply_in[2];
};

void peer_start(struct peer *p, enum peer_scheme scheme, int exact, double h, double cutoff, double p0, double forgetting);
void peer_update(struct peer *p, const double q[2], const double tau[2]);
long peer_size(void);
/* Many samples in one call, so that no call into another language is counted. */
void peer_run(struct peer *p, const double *q, const double *tau, long samples);

#endif
