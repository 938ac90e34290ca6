// Where a work-item stands on the stage's work axis. A dispatch is a part of the axis; its last workgroup may reach
// past its end.

// Number of this work-item within the dispatch.
size_t number(void) {
    return get_global_id(0);
}
