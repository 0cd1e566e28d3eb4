/* Nearby: the flow of one mesh as the start on another mesh of the same scene, for steady solves of accuracy.h. */
#pragma once
#include "sim.h"

/* The velocity of `from`, solved there, at the nodes of `to` as they lie now, into the fields of its flow. Collective
   on the communicator of both. */
PetscErrorCode NearbyStart(const SimComponents *from, const SimComponents *to);
