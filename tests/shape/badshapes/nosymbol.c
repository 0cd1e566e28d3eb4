/* A shared object that is no shape. */
int tumble_test_not_a_shape = 1;
