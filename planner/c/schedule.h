
/* Length of a dwell in ms; 0: see above. */
static inline uint16_t schedule_dwell_ms(int index)
{
    uint16_t ms;
    SCHEDULE_COPY(&ms, schedule_ms, index);
    return ms;
}

/* Where the head's centre should be at a time since the start. */
static inline schedule_checkpoint schedule_checkpoint_at(int index)
{
    schedule_checkpoint checkpoint;
    SCHEDULE_COPY(&checkpoint, schedule_checkpoints, index);
    return checkpoint;
}

