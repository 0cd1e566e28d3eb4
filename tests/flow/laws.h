/* The generalised Newtonian laws, each with numbers that bend it, for tests. */
#pragma once

static const char *const LAWS[] = {
  "-flow_rheology power_law -flow_rheology_index 0.5",
  "-flow_rheology power_law -flow_rheology_index 1.5",
  "-flow_rheology carreau -flow_rheology_index 0.4 -flow_rheology_viscosity_infinity 0.01 -flow_rheology_yasuda 1.5",
  "-flow_rheology cross -flow_rheology_index 0.3 -flow_rheology_time 0.2",
  "-flow_rheology bingham -flow_rheology_yield 0.3 -flow_rheology_papanastasiou 2",
  "-flow_rheology herschel_bulkley -flow_rheology_index 0.7 -flow_rheology_yield 0.3 -flow_rheology_max_viscosity_ratio 20",
};
#define NLAWS (PetscInt)(sizeof(LAWS) / sizeof(LAWS[0]))
