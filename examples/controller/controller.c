/*
 * A controller that identifies its arm while it moves it: 400 Hz, two links, no allocation.
 *
 * The arm is simulated here; in a real controller `read_encoders` and `command` talk to the hardware, and nothing else changes.
 */
#include <armgap.h>
#include <math.h>
#include <stdio.h>

#define JOINTS 2
#define PARAMETERS 9
#define SAMPLES 4000

static const double period = 0.0025;
static const double truth[PARAMETERS] = {2.3516, 0.0838, 0.1019, 38.465, 1.827, 2.288, 0.175, 7.6095, 1.734};

/* The only state: an estimator and the simulated arm, both of fixed size. */
static armgap_estimator estimator;
static double arm_q[JOINTS], arm_dq[JOINTS];

static void read_encoders(double q[JOINTS])
{
	for (int j = 0; j < JOINTS; j++)
		q[j] = arm_q[j];
}

static armgap_status command(const double tau[JOINTS])
{
	return armgap_advance(ARMGAP_TWO_LINK, truth, PARAMETERS, period, arm_q, arm_dq, tau, JOINTS);
}

/* The torques (31) and (32) of Reyes and Kelly (1997). */
static void excite(double t, double tau[JOINTS])
{
	tau[0] = (1 - exp(-0.8 * t)) * 29 + 68 * sin(16 * t + 0.1) + 9 * sin(20 * t + 0.15);
	tau[1] = (1 - exp(-1.8 * t)) * 1.2 + 8 * sin(26 * t + 0.08) + 2 * sin(12 * t + 0.34);
}

static int fail(armgap_status status)
{
	fprintf(stderr, "controller: %s\n", armgap_message(status));
	return 1;
}

int main(void)
{
	armgap_settings settings;
	armgap_status status = armgap_settings_default(&settings, ARMGAP_TWO_LINK);
	if (status == ARMGAP_OK)
		status = armgap_start(&estimator, sizeof estimator, &settings, NULL, 0);
	if (status != ARMGAP_OK)
		return fail(status);

	for (int k = 0; k < SAMPLES; k++) { /* every 2.5 ms */
		double q[JOINTS], tau[JOINTS];
		read_encoders(q);
		excite(k * period, tau);
		status = armgap_update_after(&estimator, period, q, NULL, tau, JOINTS);
		if (status < 0)
			return fail(status);
		status = command(tau);
		if (status != ARMGAP_OK)
			return fail(status);
	}

	double theta[PARAMETERS], sigma[PARAMETERS];
	armgap_report report;
	if ((status = armgap_theta(&estimator, theta, PARAMETERS)) != ARMGAP_OK ||
	    (status = armgap_sigma(&estimator, sigma, PARAMETERS)) != ARMGAP_OK ||
	    (status = armgap_report_of(&estimator, &report)) != ARMGAP_OK)
		return fail(status);
	for (int i = 0; i < PARAMETERS; i++)
		printf("%d %.6f +- %.2g (truth %.6f)\n", i + 1, theta[i], sigma[i], truth[i]);
	printf("updates %llu rejected %llu excitation %.2f\n", (unsigned long long)report.updates,
	       (unsigned long long)report.rejected, report.excitation);
	return 0;
}
