"""Synthetic wheel-on-soil recordings with concealed physics: the frozen judge of ``bevameter explain``.

Written independently of the package it judges: it shares no code with it, only the file formats and the public names
of the
effects. ``generate.make(seed)`` gives a recording and its truth, ``generate.write(seed, folder, truth_folder)``
writes both,
the truth apart. Everything follows from the seed alone.

The modules, from the ground up: ``contact`` (the textbook wheel and its force balance), ``drives`` (protocols of
loading),
``effect`` (what an effect may change), ``soil_effects``, ``vehicle_effects``, ``instrument_effects`` and ``beyond``
(the
effects), ``scene`` (wheel, soil, drive and the model that joins them with effects), ``evidence`` (how strongly an
effect
shows, in nats), ``sensors`` (noise and faults of the readings), ``plan`` (what each seed holds), ``generate``.
"""
